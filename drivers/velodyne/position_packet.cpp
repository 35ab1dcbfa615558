// SPDX-License-Identifier: Apache-2.0
#include "drivers/velodyne/position_packet.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

#include "drivers/wire.hpp"

namespace locus::velodyne {

namespace {

constexpr std::size_t kPpsAt = 0xCA;
constexpr std::size_t kNmeaAt = 0xCE;
constexpr std::size_t kNmeaBytes = 128;

constexpr double kMpsPerKnot = 1852.0 / 3600.0;

template <class Number> std::optional<Number> parse_number(std::string_view text, int base = 10) {
  Number value{};
  const char* end = text.data() + text.size();
  std::from_chars_result result{};
  if constexpr (std::is_floating_point_v<Number>)
    result = std::from_chars(text.data(), end, value, std::chars_format::fixed);
  else
    result = std::from_chars(text.data(), end, value, base);
  if (text.empty() || result.ec != std::errc{} || result.ptr != end)
    return std::nullopt;
  return value;
}

/// Returns the text between $ and *, if the two digits after it are its checksum.
std::optional<std::string_view> checked_body(std::string_view sentence) {
  const std::size_t star = sentence.find('*');
  if (!sentence.starts_with('$') || star == std::string_view::npos || star + 3 > sentence.size())
    return std::nullopt;
  const std::string_view body = sentence.substr(1, star - 1);
  unsigned checksum = 0;
  for (const char c : body)
    checksum ^= static_cast<unsigned char>(c);
  if (parse_number<unsigned>(sentence.substr(star + 1, 2), 16) != checksum)
    return std::nullopt;
  return body;
}

/// Parses hhmmss or hhmmss.sss.
std::optional<Duration> parse_time_of_day(std::string_view text) {
  if (text.size() < 6)
    return std::nullopt;
  const auto hours = parse_number<unsigned>(text.substr(0, 2));
  const auto minutes = parse_number<unsigned>(text.substr(2, 2));
  const auto seconds = parse_number<double>(text.substr(4));
  if (!hours || !minutes || !seconds || *hours > 23 || *minutes > 59 || !(*seconds >= 0.0 && *seconds < 61.0))
    return std::nullopt;
  return std::chrono::hours{*hours} + std::chrono::minutes{*minutes} + from_seconds(*seconds);
}

/// Parses ddmmyy in this century.
std::optional<std::chrono::year_month_day> parse_date(std::string_view text) {
  if (text.size() != 6)
    return std::nullopt;
  const auto day = parse_number<unsigned>(text.substr(0, 2));
  const auto month = parse_number<unsigned>(text.substr(2, 2));
  const auto year = parse_number<int>(text.substr(4, 2));
  if (!day || !month || !year)
    return std::nullopt;
  const std::chrono::year_month_day date{std::chrono::year{2000 + *year}, std::chrono::month{*month},
                                         std::chrono::day{*day}};
  return date.ok() ? std::optional{date} : std::nullopt;
}

} // namespace

std::optional<RmcSentence> parse_rmc(std::string_view sentence) {
  enum Field : std::size_t { kType, kTime, kStatus, kSpeed = 7, kCourse = 8, kDate = 9, kFieldCount = 10 };

  const auto body = checked_body(sentence);
  if (!body)
    return std::nullopt;
  std::array<std::string_view, kFieldCount> fields;
  std::string_view rest = *body;
  for (std::string_view& field : fields) {
    field = rest.substr(0, rest.find(','));
    rest.remove_prefix(std::min(rest.size(), field.size() + 1));
  }
  const auto time_of_day = parse_time_of_day(fields[kTime]);
  if ((fields[kType] != "GPRMC" && fields[kType] != "GNRMC") || !time_of_day)
    return std::nullopt;

  RmcSentence rmc;
  rmc.valid = fields[kStatus] == "A";
  rmc.time_of_day = *time_of_day;
  rmc.date = parse_date(fields[kDate]);
  if (const auto knots = parse_number<double>(fields[kSpeed]))
    rmc.speed_mps = *knots * kMpsPerKnot;
  rmc.course_deg = parse_number<double>(fields[kCourse]);
  return rmc;
}

PositionPacket parse_position_packet(std::span<const std::byte, kPositionPacketBytes> payload) {
  std::array<char, kNmeaBytes> nmea;
  std::transform(payload.begin() + kNmeaAt, payload.begin() + kNmeaAt + kNmeaBytes, nmea.begin(),
                 [](std::byte b) { return std::to_integer<char>(b); });
  const auto pps = std::to_integer<std::uint8_t>(payload[kPpsAt]);
  return {.time_of_hour = std::chrono::microseconds{read_u32(payload.data() + kTimeOfHourOffset)},
          .pps = pps <= static_cast<std::uint8_t>(PpsState::error) ? static_cast<PpsState>(pps) : PpsState::error,
          .rmc = parse_rmc({nmea.data(), nmea.size()})};
}

} // namespace locus::velodyne
