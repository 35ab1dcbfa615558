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

/// Splits off the next sentence of a text: from a $ to before the next one. Empty if there is none.
std::string_view pop_sentence(std::string_view& text) {
  text.remove_prefix(std::min(text.find('$'), text.size()));
  const std::string_view sentence = text.substr(0, text.find('$', 1));
  text.remove_prefix(sentence.size());
  return sentence;
}

/// Tells whether a sentence begins with a talker of two capitals (GP, GN, GL, GA, GB, BD, QZ, ...) and the type RMC.
bool is_rmc(std::string_view sentence) {
  constexpr std::string_view kType = "RMC,";
  constexpr std::size_t kTypeAt = 3;
  const auto is_capital = [](char c) { return c >= 'A' && c <= 'Z'; };
  return sentence.size() > kTypeAt && is_capital(sentence[1]) && is_capital(sentence[2]) &&
         sentence.substr(kTypeAt).starts_with(kType);
}

/// Tells whether a sentence begins as one of any type, rather than at a stray $: $GPGGA, or $PUBX of a maker's own.
bool is_any(std::string_view sentence) {
  const std::size_t address = sentence.starts_with("$P") ? 5 : 6;
  const auto is_of_address = [](char c) { return (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9'); };
  return sentence.size() > address && std::ranges::all_of(sentence.substr(1, address - 1), is_of_address);
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

namespace {

/// Parses one RMC sentence. Returns why it is unusable, or no_fix or good with `rmc` filled.
Nmea parse_sentence(std::string_view sentence, std::optional<RmcSentence>& rmc) {
  enum Field : std::size_t { kType, kTime, kStatus, kSpeed = 7, kCourse = 8, kDate = 9, kFieldCount = 10 };

  const std::size_t star = sentence.find('*');
  if (star == std::string_view::npos || star + 3 > sentence.size())
    return Nmea::no_checksum;
  const std::string_view body = sentence.substr(1, star - 1);
  unsigned checksum = 0;
  for (const char c : body)
    checksum ^= static_cast<unsigned char>(c);
  if (parse_number<unsigned>(sentence.substr(star + 1, 2), 16) != checksum)
    return Nmea::wrong_checksum;
  std::array<std::string_view, kFieldCount> fields;
  std::string_view rest = body;
  for (std::string_view& field : fields) {
    field = rest.substr(0, rest.find(','));
    rest.remove_prefix(std::min(rest.size(), field.size() + 1));
  }
  const auto time_of_day = parse_time_of_day(fields[kTime]);
  if (!time_of_day)
    return Nmea::no_time;
  rmc.emplace();
  rmc->valid = fields[kStatus] == "A";
  rmc->time_of_day = *time_of_day;
  rmc->date = parse_date(fields[kDate]);
  if (const auto knots = parse_number<double>(fields[kSpeed]))
    rmc->speed_mps = *knots * kMpsPerKnot;
  rmc->course_deg = parse_number<double>(fields[kCourse]);
  return rmc->valid ? Nmea::good : Nmea::no_fix;
}

} // namespace

NmeaText parse_nmea(std::string_view text) {
  NmeaText best;
  for (std::string_view sentence = pop_sentence(text); !sentence.empty(); sentence = pop_sentence(text)) {
    NmeaText one;
    one.state = is_rmc(sentence) ? parse_sentence(sentence, one.rmc) : is_any(sentence) ? Nmea::no_rmc : Nmea::none;
    if (one.state > best.state)
      best = one;
  }
  return best;
}

std::string_view why_unused(const PositionPacket& packet) {
  if (packet.pps != PpsState::locked)
    return {};
  switch (packet.nmea) {
  case Nmea::none:
    return "its position packets hold no NMEA sentence (connect the receiver's serial output to the lidar, and check "
           "its baud rate)";
  case Nmea::no_rmc:
    return "its position packets hold NMEA sentences, but no RMC (let the receiver send $GPRMC once a second)";
  case Nmea::no_checksum:
    return "its RMC sentences are cut short or have no checksum (let the receiver add one, and send RMC alone)";
  case Nmea::wrong_checksum:
    return "the checksums of its RMC sentences are wrong (check the serial line from the receiver to the lidar)";
  case Nmea::no_time:
    return "its RMC sentences hold no time (check the receiver and its antenna)";
  case Nmea::no_fix:
    return "its receiver has no fix, by the status of its RMC sentences (check its antenna)";
  case Nmea::good:
    return {};
  }
  return {};
}

PositionPacket parse_position_packet(std::span<const std::byte, kPositionPacketBytes> payload) {
  std::array<char, kPositionPacketBytes> text;
  std::ranges::transform(payload, text.begin(), [](std::byte b) { return std::to_integer<char>(b); });
  const NmeaText nmea = parse_nmea({text.data(), text.size()});
  const auto pps = std::to_integer<std::uint8_t>(payload[kPpsAt]);
  return {.time_of_hour = std::chrono::microseconds{read_u32(payload.data() + kTimeOfHourOffset)},
          .pps = pps <= static_cast<std::uint8_t>(PpsState::error) ? static_cast<PpsState>(pps) : PpsState::error,
          .nmea = nmea.state,
          .rmc = nmea.rmc};
}

} // namespace locus::velodyne
