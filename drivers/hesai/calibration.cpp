// SPDX-License-Identifier: Apache-2.0
#include "drivers/hesai/calibration.hpp"

#include <array>
#include <bitset>
#include <charconv>
#include <cmath>
#include <fstream>
#include <optional>
#include <string_view>

#include <fmt/format.h>

#include "core/base/pose.hpp"

namespace locus::hesai {

namespace {

constexpr std::size_t kLongestFile = 100'000; ///< bytes; 20 times the file of 128 lasers
constexpr double kSteepestDeg = 90.0, kFarthestDeg = 180.0;

using Fields = std::array<std::string_view, 3>;

/// Returns the first three fields of a line without surrounding blanks; empty if there are fewer.
std::optional<Fields> fields_of(std::string_view line) {
  Fields fields;
  for (std::string_view& field : fields) {
    if (line.data() == nullptr)
      return std::nullopt;
    const std::size_t comma = line.find(',');
    field = line.substr(0, comma);
    line = comma == std::string_view::npos ? std::string_view{} : line.substr(comma + 1);
    const auto is_blank = [](char c) { return c == ' ' || c == '\t' || c == '\r'; };
    while (!field.empty() && is_blank(field.front()))
      field.remove_prefix(1);
    while (!field.empty() && is_blank(field.back()))
      field.remove_suffix(1);
  }
  return fields;
}

template <class Number> std::optional<Number> number(std::string_view text) {
  Number value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc{} && end == text.data() + text.size() ? std::optional{value} : std::nullopt;
}

std::optional<double> angle(std::string_view text, double most_deg) {
  const auto angle_deg = number<double>(text);
  return angle_deg && std::abs(*angle_deg) <= most_deg ? angle_deg : std::nullopt;
}

bool is_head(const Fields& fields) {
  return (fields[0] == "Laser id" || fields[0] == "Channel") && fields[1] == "Elevation" && fields[2] == "Azimuth";
}

/// Parser of the lines of a calibration file.
class Reader {
 public:
  /// Parses a line. Returns an error, or nothing if the line is valid.
  std::optional<std::string> read_line(std::string_view line) {
    const auto fields = fields_of(line);
    if (!has_head_) {
      has_head_ = fields && is_head(*fields);
      const bool is_version = line.starts_with("EEFF") || line.starts_with("eeff");
      return has_head_ || is_version ? std::nullopt
                                     : std::optional<std::string>{"\"Laser id,Elevation,Azimuth\" is expected; give "
                                                                  "the angle correction file of the lidar"};
    }
    const auto laser = fields ? number<std::size_t>((*fields)[0]) : std::nullopt;
    if (!laser)
      return read_other_line(line);
    if (is_over_ || *laser == 0 || *laser > kMaxChannels)
      return fmt::format("laser {}: they count from 1 to {} at most", *laser, kMaxChannels);
    if (present_.test(*laser - 1))
      return fmt::format("laser {} is there twice", *laser);
    const auto elevation_deg = angle((*fields)[1], kSteepestDeg), azimuth_deg = angle((*fields)[2], kFarthestDeg);
    if (!elevation_deg || !azimuth_deg)
      return fmt::format("laser {}: Elevation must be a number from -90 to 90, Azimuth one from -180 to 180", *laser);
    present_.set(*laser - 1);
    calibration_.storage[*laser - 1] = {*elevation_deg * kRadPerDeg, *azimuth_deg * kRadPerDeg, 0};
    return std::nullopt;
  }

  /// Completes the calibration after the last line.
  Expected<Calibration, std::string> finish() {
    if (!has_head_ || present_.none())
      return std::string{"no lasers in it; give the angle correction file of the lidar"};
    calibration_.laser_count = present_.count();
    for (std::size_t i = 0; i < calibration_.laser_count; ++i)
      if (!present_.test(i))
        return fmt::format("laser {} is missing", i + 1);
    calibration_.assign_rings();
    return calibration_;
  }

 private:
  /// Parses an empty line, or the hash after all lasers.
  std::optional<std::string> read_other_line(std::string_view line) {
    if (line.find_first_not_of(" \t\r,") == std::string_view::npos)
      return std::nullopt;
    const bool is_hash =
        present_.any() && !is_over_ && line.find_first_not_of("0123456789abcdefABCDEF, \r") == std::string_view::npos;
    is_over_ = is_hash;
    return is_hash ? std::nullopt : std::optional<std::string>{"a laser, its elevation and its azimuth are expected"};
  }

  Calibration calibration_;
  std::bitset<kMaxChannels> present_;
  bool has_head_ = false, is_over_ = false;
};

} // namespace

Expected<Calibration, std::string> parse_calibration(std::string_view text, std::string_view name) {
  if (text.size() > kLongestFile)
    return fmt::format("{}: too long for the angles of 128 lasers; give the angle correction file of the lidar", name);
  constexpr std::string_view kMark = "\xEF\xBB\xBF"; // UTF-8 byte order mark
  text.remove_prefix(text.starts_with(kMark) ? kMark.size() : 0);
  Reader reader;
  for (int line = 1; !text.empty(); ++line) {
    const std::size_t end = text.find('\n');
    if (const auto problem = reader.read_line(text.substr(0, end)))
      return fmt::format("{}:{}: {}", name, line, *problem);
    text = end == std::string_view::npos ? std::string_view{} : text.substr(end + 1);
  }
  auto calibration = reader.finish();
  return calibration ? std::move(calibration)
                     : Expected<Calibration, std::string>{fmt::format("{}: {}", name, calibration.error())};
}

Expected<Calibration, std::string> read_calibration(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  if (!stream)
    return file.string() + ": cannot be read; give the angle correction file of the lidar, or leave the key empty for "
                           "the model's own table";
  std::string text(kLongestFile + 1, '\0');
  stream.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(stream.gcount()));
  return parse_calibration(text, file.string());
}

} // namespace locus::hesai
