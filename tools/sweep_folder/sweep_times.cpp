// SPDX-License-Identifier: Apache-2.0
#include "sweep_folder/sweep_times.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <fstream>
#include <optional>
#include <string_view>
#include <system_error>

#include <fmt/format.h>

#include "drivers/files/motion_rows.hpp"

namespace locus::tools {
namespace {

constexpr double kShortest_s = 0.005, kLongest_s = 5.0;

double median(std::vector<double> numbers) {
  const auto middle = numbers.begin() + static_cast<std::ptrdiff_t>(numbers.size() / 2);
  std::ranges::nth_element(numbers, middle);
  return *middle;
}

/// Returns the unit as a power of ten of seconds; nothing if none fits. A single time counts as seconds.
std::optional<int> unit_of(std::span<const double> numbers) {
  if (numbers.size() < 2)
    return 0;
  std::vector<double> steps;
  for (std::size_t i = 1; i < numbers.size(); ++i)
    steps.push_back(std::abs(numbers[i] - numbers[i - 1]));
  const double step = median(std::move(steps));
  for (const int exponent : {0, -3, -6, -9}) {
    const double step_s = step * std::pow(10.0, exponent);
    if (step_s >= kShortest_s && step_s < kLongest_s)
      return exponent;
  }
  return std::nullopt;
}

/// Parses a number for determining the unit; 0 if invalid, which is reported when it is read.
double roughly(const std::string& text) {
  double number = 0.0;
  std::from_chars(text.data(), text.data() + text.size(), number);
  return std::isfinite(number) ? number : 0.0;
}

} // namespace

Expected<std::vector<TimeText>, std::string> read_times(const std::filesystem::path& file) {
  constexpr std::uintmax_t kMostBytes = 10'000'000; // hours of sweeps and their names
  std::error_code error;
  std::ifstream stream{file};
  if (!stream)
    return fmt::format("{}: cannot be read; check its permissions", file.string());
  if (std::filesystem::file_size(file, error) > kMostBytes)
    return fmt::format("{}: is too long for a table of the times of sweeps; use a shorter one", file.string());
  std::vector<TimeText> times;
  std::size_t number = 0;
  for (std::string buffer; std::getline(stream, buffer);) {
    ++number;
    const std::string_view line = trimmed(buffer);
    if (line.empty() || line.starts_with('#'))
      continue;
    const std::size_t end = std::min(line.find_first_of(", \t"), line.size());
    const std::string_view time = line.substr(0, end);
    std::string_view rest = line.substr(end);
    rest.remove_prefix(std::min(rest.find_first_not_of(", \t"), rest.size()));
    if (times.empty() && is_header(std::array{time}))
      continue;
    const bool names_file = rest.ends_with(".pcd") || rest.ends_with(".bin");
    times.push_back(
        {std::string{time}, names_file ? std::string{rest} : "", fmt::format("{}:{}", file.string(), number)});
  }
  return times;
}

Expected<std::vector<Stamp>, std::string> stamps_of(std::span<const TimeText> times) {
  std::vector<double> numbers;
  for (const TimeText& time : times)
    numbers.push_back(roughly(time.text));
  const std::optional<int> unit = unit_of(numbers);
  if (!unit)
    return fmt::format("{}: in no unit of s, ms, us and ns are sweeps 5 ms to 5 s apart; the first number of each line "
                       "must be the time of a sweep",
                       times.front().place);
  std::vector<Stamp> stamps;
  for (const TimeText& time : times) {
    const std::optional<Stamp> stamp = parse_time(time.text, *unit);
    if (!stamp)
      return fmt::format("{}: {} is not a time in seconds or nanoseconds since 1970; correct it", time.place,
                         time.text);
    if (!stamps.empty() && *stamp <= stamps.back())
      return fmt::format("{}: {} is {} the time before it; sort and correct the times, one for each sweep", time.place,
                         time.text, *stamp == stamps.back() ? "equal to" : "before");
    stamps.push_back(*stamp);
  }
  return stamps;
}

Duration usual_step(std::span<const Stamp> stamps) {
  constexpr double kDefault_s = 0.1;
  std::vector<double> steps_s;
  for (std::size_t i = 1; i < stamps.size(); ++i)
    steps_s.push_back(to_seconds(stamps[i] - stamps[i - 1]));
  return from_seconds(steps_s.empty() ? kDefault_s : std::max(median(std::move(steps_s)), kShortest_s));
}

} // namespace locus::tools
