// SPDX-License-Identifier: Apache-2.0
#include "trace.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <sstream>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

namespace locus::test {
namespace {

/// Blocks of figures in a line: pose, twist, standard deviations; six each.
constexpr std::size_t kPosition = 0, kAngles = 3, kVelocity = 6, kTurnRate = 9, kSigma = 12;

constexpr std::string_view kColumns =
    "     t_s state                 x_m        y_m        z_m  roll_deg pitch_deg   yaw_deg  vx_mps  vy_mps  vz_mps "
    "wx_rad/s wy_rad/s wz_rad/s sigma: x_m     y_m     z_m roll_rad pitch_rad yaw_rad";

constexpr std::array<std::string_view, 4> kStates{"tracking", "degenerate", "dead_reckoning", "standstill"};

std::string read_file(const std::filesystem::path& file) {
  std::ifstream stream{file, std::ios::binary};
  if (!stream)
    throw std::runtime_error(file.string() + " cannot be read");
  return {std::istreambuf_iterator<char>{stream}, {}};
}

template <class Matrix> void add_all(Checksum& sum, const Matrix& numbers) {
  for (Eigen::Index row = 0; row < numbers.rows(); ++row) {
    for (Eigen::Index column = 0; column < numbers.cols(); ++column)
      sum.add_value(numbers(row, column));
  }
}

std::string checksum_of(const std::vector<OdometryEstimate>& estimates) {
  Checksum sum;
  for (const OdometryEstimate& estimate : estimates) {
    sum.add_value(to_ns(estimate.stamp));
    sum.add_value(static_cast<std::uint8_t>(estimate.state));
    sum.add_value(static_cast<std::uint8_t>(estimate.failed));
    add_all(sum, estimate.T_odom_base.translation);
    add_all(sum, estimate.T_odom_base.rotation.coeffs());
    add_all(sum, estimate.twist_base);
    add_all(sum, estimate.pose_covariance);
    add_all(sum, estimate.twist_covariance);
  }
  return sum.text();
}

std::string text_of(const OdometryEstimate& estimate, Stamp start) {
  const Eigen::Vector3d& position_m = estimate.T_odom_base.translation;
  const Eigen::Vector3d rpy_deg = to_rpy_rad(estimate.T_odom_base.rotation) / kRadPerDeg;
  const Vector6& twist = estimate.twist_base;
  std::string text = fmt::format("{:8.3f} {:14}", to_seconds(estimate.stamp - start),
                                 kStates[static_cast<std::size_t>(estimate.state)]);
  for (const double metres : position_m)
    text += fmt::format(" {:10.5f}", metres);
  for (const double degrees : rpy_deg)
    text += fmt::format(" {:9.4f}", degrees);
  for (const double mps : twist.head<3>())
    text += fmt::format(" {:7.4f}", mps);
  for (const double radps : twist.tail<3>())
    text += fmt::format(" {:8.5f}", radps);
  for (const double variance : estimate.pose_covariance.diagonal())
    text += fmt::format(" {:.2e}", std::sqrt(variance));
  return text;
}

std::optional<Trace::Line> parse_line(const std::string& text) {
  std::istringstream stream{text};
  const std::vector<std::string> words{std::istream_iterator<std::string>{stream}, {}};
  Trace::Line line{text, 0, "", {}};
  if (words.size() != 2 + line.numbers.size())
    return std::nullopt;
  bool good = true;
  const auto number = [&](const std::string& word) { // not a stream, which cannot parse NaN
    char* end = nullptr;
    const double value = std::strtod(word.c_str(), &end);
    good = good && *end == 0;
    return value;
  };
  line.t_s = number(words[0]);
  line.state = words[1];
  std::ranges::transform(words.begin() + 2, words.end(), line.numbers.begin(), number);
  return good ? std::optional(std::move(line)) : std::nullopt;
}

/// Selects the sweeps shown: of drives up to three seconds all, or every third if there are many; else the first of
/// each second. Always includes the last.
std::vector<std::size_t> shown_of(const std::vector<OdometryEstimate>& estimates) {
  constexpr double kShort_s = 3;
  constexpr std::size_t kMany = 20;
  std::vector<std::size_t> shown;
  const auto since_start_s = [&](std::size_t i) { return to_seconds(estimates[i].stamp - estimates.front().stamp); };
  const bool is_short = !estimates.empty() && since_start_s(estimates.size() - 1) <= kShort_s;
  const std::size_t step = estimates.size() > kMany ? 3 : 1;
  double next_s = 0;
  for (std::size_t i = 0; i < estimates.size(); ++i) {
    const bool due = is_short ? i % step == 0 : since_start_s(i) >= next_s;
    if (!due && i + 1 != estimates.size())
      continue;
    shown.push_back(i);
    next_s = std::floor(since_start_s(i)) + 1;
  }
  return shown;
}

/// Returns the differences of two lines, the maximum for each kind of figure.
Tolerance distance(const Trace::Line& one, const Trace::Line& other) {
  const auto at = [&](std::size_t first) {
    const auto three = [&](const Trace::Line& line) {
      return Eigen::Vector3d{line.numbers[first], line.numbers[first + 1], line.numbers[first + 2]};
    };
    return std::pair(three(one), three(other));
  };
  const auto apart = [&](std::size_t first) { return (at(first).first - at(first).second).norm(); };
  const auto [rpy_deg, other_rpy_deg] = at(kAngles);
  const Eigen::Quaterniond turn =
      from_rpy_rad(rpy_deg * kRadPerDeg).conjugate() * from_rpy_rad(other_rpy_deg * kRadPerDeg);
  double sigma_share = 0;
  for (std::size_t i = kSigma; i < one.numbers.size(); ++i) {
    const double share = one.numbers[i] == other.numbers[i] ? 0 : std::abs(other.numbers[i] / one.numbers[i] - 1);
    sigma_share = std::max(sigma_share, std::isfinite(share) ? share : HUGE_VAL);
  }
  return {apart(kPosition), angle_rad(turn), apart(kVelocity), apart(kTurnRate), sigma_share};
}

/// Returns the maximum of each difference over all common lines.
Tolerance largest_distance(const Trace& one, const Trace& other) {
  Tolerance largest{0, 0, 0, 0, 0};
  for (std::size_t i = 0; i < std::min(one.lines.size(), other.lines.size()); ++i) {
    const Tolerance here = distance(one.lines[i], other.lines[i]);
    largest = {std::max(largest.position_m, here.position_m), std::max(largest.rotation_rad, here.rotation_rad),
               std::max(largest.velocity_mps, here.velocity_mps),
               std::max(largest.turn_rate_radps, here.turn_rate_radps),
               std::max(largest.sigma_share, here.sigma_share)};
  }
  return largest;
}

std::string in_words(const Tolerance& largest) {
  return fmt::format(
      "position {:.5f} m, rotation {:.6f} rad, velocity {:.4f} m/s, turn rate {:.5f} rad/s, sigma {:.1f} "
      "%",
      largest.position_m, largest.rotation_rad, largest.velocity_mps, largest.turn_rate_radps,
      100 * largest.sigma_share);
}

/// Returns the first line for which `differs` holds.
template <class Differs>
std::optional<std::string> first_difference(const Trace& accepted, const Trace& found, const Differs& differs) {
  for (std::size_t i = 0; i < std::max(accepted.lines.size(), found.lines.size()); ++i) {
    const bool both = i < accepted.lines.size() && i < found.lines.size();
    if (!both || differs(accepted.lines[i], found.lines[i]))
      return fmt::format("  first line that differs:\n    was {}\n    is  {}\n",
                         i < accepted.lines.size() ? accepted.lines[i].text : "(none)",
                         i < found.lines.size() ? found.lines[i].text : "(none)");
  }
  return std::nullopt;
}

} // namespace

void Checksum::add(std::string_view bytes) {
  for (const char byte : bytes)
    sum_ = (sum_ ^ static_cast<unsigned char>(byte)) * 0x100000001b3U;
}

std::string Checksum::text() const { return fmt::format("{:016x}", sum_); }

std::string checksum_of(const std::filesystem::path& recording) {
  std::vector<std::filesystem::path> files{recording};
  if (std::filesystem::is_directory(recording)) {
    files.clear();
    for (const auto& entry : std::filesystem::directory_iterator{recording})
      files.push_back(entry.path());
    std::ranges::sort(files);
  }
  Checksum sum;
  for (const std::filesystem::path& file : files) {
    sum.add(file.filename().string());
    sum.add(read_file(file));
  }
  return sum.text();
}

Trace Trace::of(const std::string& options, const std::string& recording,
                const std::vector<OdometryEstimate>& estimates) {
  Trace trace{options, recording, checksum_of(estimates), estimates.size(), {}};
  for (const std::size_t i : shown_of(estimates))
    trace.lines.push_back(*parse_line(text_of(estimates[i], estimates.front().stamp)));
  return trace;
}

std::string Trace::text() const {
  std::string text =
      fmt::format("{}\nrecording {}\nestimates {} of {} sweeps\n{}\n", options, recording, estimates, sweeps, kColumns);
  for (const Line& line : lines)
    text += line.text + '\n';
  return text;
}

std::optional<Trace> Trace::parse(const std::string& text) {
  std::istringstream stream{text};
  Trace trace;
  std::string word, of, unit, columns;
  std::getline(stream, trace.options);
  stream >> word >> trace.recording >> word >> trace.estimates >> of >> trace.sweeps >> unit >> std::ws;
  if (!std::getline(stream, columns) || columns != std::string{kColumns}.substr(kColumns.find_first_not_of(' ')))
    return std::nullopt;
  for (std::string line; std::getline(stream, line);) {
    std::optional<Line> parsed = parse_line(line);
    if (!parsed)
      return std::nullopt;
    trace.lines.push_back(std::move(*parsed));
  }
  return trace;
}

std::optional<std::string> difference(const Trace& accepted, const Trace& found) {
  if (accepted.text() == found.text())
    return std::nullopt;
  std::string words;
  if (accepted.options != found.options)
    words += fmt::format("  it was {}\n  it is  {}\n", accepted.options, found.options);
  if (accepted.recording != found.recording)
    words += "  the recording itself is another one: look there before the odometry\n";
  const auto first = first_difference(
      accepted, found, [](const Trace::Line& one, const Trace::Line& other) { return one.text != other.text; });
  if (!first && accepted.estimates != found.estimates)
    return words + "  no line differs: the last bits do, or sweeps between the lines\n";
  return words + first.value_or("") +
         fmt::format("  largest change: {}\n", in_words(largest_distance(accepted, found)));
}

std::optional<std::string> difference_beyond(const Tolerance& tolerance, const Trace& accepted, const Trace& found) {
  const auto first = first_difference(accepted, found, [&](const Trace::Line& one, const Trace::Line& other) {
    const Tolerance apart = distance(one, other);
    const bool within = apart.position_m <= tolerance.position_m && apart.rotation_rad <= tolerance.rotation_rad &&
                        apart.velocity_mps <= tolerance.velocity_mps &&
                        apart.turn_rate_radps <= tolerance.turn_rate_radps &&
                        apart.sigma_share <= tolerance.sigma_share;
    return !within || one.t_s != other.t_s || one.state != other.state;
  });
  if (!first)
    return std::nullopt;
  return *first + fmt::format("  largest change: {}\n  allowed:        {}\n",
                              in_words(largest_distance(accepted, found)), in_words(tolerance));
}

} // namespace locus::test
