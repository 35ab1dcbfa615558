// SPDX-License-Identifier: Apache-2.0
#include "drivers/files/motion_rows.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <limits>
#include <system_error>

namespace locus {
namespace {

constexpr std::size_t kMaxFields = FieldSplitter::kMaxFields;

template <class Number> bool parse(std::string_view text, Number& number) {
  const char* end = text.data() + text.size();
  const char* begin = text.data() + (text.starts_with('+') ? 1 : 0); // from_chars does not accept a plus sign
  const auto [stop, error] = std::from_chars(begin, end, number);
  return error == std::errc{} && stop == end;
}

bool parse_all(Fields fields, std::span<double> numbers) {
  return std::ranges::equal(fields, numbers, [](std::string_view text, double& number) { return parse(text, number); });
}

bool is_sensible(Stamp stamp) { return stamp > kEarliestStamp && stamp < kLatestStamp; }

/// Parses an integer number of nanoseconds.
std::optional<Stamp> parse_ns(std::string_view text) {
  std::int64_t ns = 0;
  return parse(text, ns) && is_sensible(stamp_from_ns(ns)) ? std::optional{stamp_from_ns(ns)} : std::nullopt;
}

} // namespace

std::optional<Stamp> parse_time(std::string_view text, int unit_exponent) {
  constexpr int kMaxExponent = 18;
  const std::size_t exponent_at = std::min(text.find_first_of("eE"), text.size());
  int exponent = 0;
  if (exponent_at < text.size() &&
      (!parse(text.substr(exponent_at + 1), exponent) || exponent < -kMaxExponent || exponent > kMaxExponent)) {
    return std::nullopt;
  }
  const bool negative = text.starts_with('-');
  std::string digits{text.substr(negative ? 1 : 0, exponent_at - (negative ? 1 : 0))};
  const std::size_t point = std::min(digits.find('.'), digits.size());
  if (point < digits.size()) {
    digits.erase(point, 1);
  }
  if (digits.empty() || digits.find_first_not_of("0123456789") != std::string::npos) {
    return std::nullopt;
  }
  const int digits_of_ns = static_cast<int>(point) + exponent + unit_exponent + 9;
  if (digits_of_ns <= 0) {
    return Stamp{};
  }
  const auto kept = static_cast<std::size_t>(digits_of_ns);
  const bool rounds_up = kept < digits.size() && digits[kept] >= '5';
  digits.resize(kept, '0');
  const std::optional<Stamp> stamp = parse_ns(digits);
  if (!stamp) {
    return std::nullopt;
  }
  const std::int64_t ns = to_ns(*stamp) + (rounds_up ? 1 : 0);
  return stamp_from_ns(negative ? -ns : ns);
}

namespace {

std::optional<Stamp> parse_seconds(std::string_view text) { return parse_time(text, 0); }

} // namespace

std::optional<Eigen::Quaterniond> unit_quaternion(double w, double x, double y, double z) {
  constexpr double kTolerance = 0.05;
  constexpr double kRounding = 4 * std::numeric_limits<double>::epsilon();
  const Eigen::Quaterniond q{w, x, y, z};
  if (std::abs(q.norm() - 1.0) > kTolerance) {
    return std::nullopt;
  }
  return std::abs(q.squaredNorm() - 1.0) < kRounding ? q : q.normalized(); // preserves the digits of a recorded one
}

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view kBlanks = " \t\r";
  const std::size_t first = text.find_first_not_of(kBlanks);
  return first == std::string_view::npos ? std::string_view{}
                                         : text.substr(first, text.find_last_not_of(kBlanks) - first + 1);
}

bool is_header(Fields fields) {
  return std::ranges::none_of(fields, [](std::string_view field) {
    double ignored = 0.0;
    return parse(field, ignored);
  });
}

Problem parse_imu(Fields fields, ImuSample& sample) {
  if (fields.size() != 7 && fields.size() != 11) {
    return fmt::format("{} columns; expected t_ns,wx,wy,wz,ax,ay,az and optionally qw,qx,qy,qz",
                       fields.size() > kMaxFields ? "too many" : std::to_string(fields.size()));
  }
  const std::optional<Stamp> time = parse_ns(fields[0]);
  if (!time) {
    return fmt::format(
        "time \"{}\" is not a whole number of nanoseconds; since 1970; write it without point or exponent", fields[0]);
  }
  std::array<double, kMaxFields - 1> v{};
  if (!parse_all(fields.subspan(1), std::span{v}.first(fields.size() - 1))) {
    return "a value is not a number; correct or remove the line";
  }
  sample.stamp = sample.arrival = *time;
  sample.angular_velocity_radps = {v[0], v[1], v[2]};
  sample.specific_force_mps2 = {v[3], v[4], v[5]};
  const bool unknown_attitude =
      fields.size() == 7 || std::all_of(v.begin() + 6, v.end(), [](double q) { return q == 0; });
  if (unknown_attitude) {
    return std::nullopt;
  }
  sample.attitude = unit_quaternion(v[6], v[7], v[8], v[9]);
  if (!sample.attitude) {
    return "the attitude is not a unit quaternion; the columns are qw,qx,qy,qz, all four 0 where it is not known";
  }
  return std::nullopt;
}

Problem parse_odometry(Fields fields, OdometrySample& sample) {
  if (fields.size() != 8) {
    return fmt::format("{} columns; expected t x y z qx qy qz qw",
                       fields.size() > kMaxFields ? "too many" : std::to_string(fields.size()));
  }
  const std::optional<Stamp> time = parse_seconds(fields[0]);
  if (!time) {
    return fmt::format("time \"{}\" is not a number of seconds since 1970; write it as 1700000000.123456789",
                       fields[0]);
  }
  std::array<double, 7> v{};
  if (!parse_all(fields.subspan(1), v)) {
    return "a value is not a number; correct or remove the line";
  }
  const std::optional<Eigen::Quaterniond> rotation = unit_quaternion(v[6], v[3], v[4], v[5]);
  if (!rotation) {
    return "the rotation is not a unit quaternion; the columns are t x y z qx qy qz qw";
  }
  sample.stamp = sample.arrival = *time;
  sample.T_source_base = {*rotation, {v[0], v[1], v[2]}};
  return std::nullopt;
}

Problem parse_meta(Fields fields, Meta& meta) {
  const std::optional<Stamp> time = fields.size() == 3 ? parse_ns(fields[0]) : std::nullopt;
  const std::optional<Stamp> arrival = fields.size() == 3 ? parse_ns(fields[1]) : std::nullopt;
  if (!time || !arrival || !parse(fields[2], meta.covariance_scale)) {
    return "expected t_ns,arrival_ns,covariance_scale: two whole numbers and a number; correct or remove the line";
  }
  meta.stamp = *time;
  meta.arrival = *arrival;
  return std::nullopt;
}

} // namespace locus
