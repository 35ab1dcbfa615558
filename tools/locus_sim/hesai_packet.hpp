// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "drivers/hesai/checksum.hpp"
#include "drivers/hesai/model.hpp"
#include "drivers/wire.hpp"

namespace locus::sim {

/// Data packet of a Hesai, built byte by byte: well-formed, turning at `rpm` (negative: counterclockwise), every
/// distance 0 until it is set, in units of kDistanceUnit_m. One owner.
class HesaiPacket {
 public:
  static constexpr double kDistanceUnit_m = 0.004;
  static constexpr Duration kTime = std::chrono::seconds{1'700'000'000};
  static constexpr std::size_t kSafety = 17, kImu = 22, kSignature = 32;

  HesaiPacket(hesai::Model model, std::uint8_t return_mode, Duration time = kTime, std::uint16_t azimuth_cdeg = 0,
              double rpm = 600.0, std::size_t sequence = 0)
      : layout_(hesai::spec(model).layout), tail_(layout_.body() + (layout_.has_checksums ? 4 + kSafety : 0)) {
    const bool has_imu = model == hesai::Model::ot128;
    bytes_.resize(tail_ + layout_.tail.bytes + 4 + (has_imu ? kImu : 0) + (layout_.has_checksums ? 4 : 0));
    if (layout_.header > 0) {
      put(0, 0xFFEE, 2);
      const std::size_t sizes = layout_.header == 8 ? 2 : 6;
      put(sizes, layout_.channels, 1);
      put(sizes + 1, layout_.blocks, 1);
      put(layout_.header - 3, 4, 1);
    }
    if (layout_.header == 12) {
      put(2, hesai::spec(model).version[0], 1);
      put(3, hesai::spec(model).version[1], 1);
      put(11, 1U | (layout_.has_checksums ? 4U : 0U) | (has_imu ? 2U : 0U), 1);
    }
    if (model == hesai::Model::ot128) {
      put(4, 128, 1);
      set_operational_state(sequence == 0 ? 1 : 0);
    }
    if (model == hesai::Model::qt128)
      set_mode_flag(sequence == 0 ? 1 : 0);
    put(tail_ + layout_.tail.return_mode, return_mode, 1);
    put(tail_ + layout_.tail.motor_speed, static_cast<std::uint64_t>(std::lround(std::abs(rpm))), 2);
    set_time(time);
    set_number(1);
    const std::size_t returns = hesai::returns_of(*hesai::return_mode_from_byte(return_mode));
    const double turn_cdeg = rpm * 600.0 * to_seconds(hesai::spec(model).sequences[sequence].column_duration);
    for (std::size_t block = 0; block < layout_.blocks; ++block) {
      if (layout_.block_header == 4)
        put(at_block(block), 0xEEFF, 2);
      const std::size_t column = block / returns;
      const auto turned_cdeg = std::lround(turn_cdeg * static_cast<double>(column));
      set_azimuth(block, static_cast<std::uint16_t>((azimuth_cdeg + turned_cdeg + 36000) % 36000));
    }
    seal();
  }

  void set_azimuth(std::size_t block, std::uint16_t cdeg) { put(at_block(block) + layout_.block_header - 2, cdeg, 2); }
  void set_return(std::size_t block, std::size_t channel, std::uint16_t distance, std::uint8_t reflectivity = 10) {
    const std::size_t at = at_block(block) + layout_.block_header + channel * layout_.channel;
    put(at, distance, 2);
    put(at + 2, reflectivity, 1);
  }
  void set_time(Duration time, int year_zero = 1900) {
    using namespace std::chrono;
    const auto day = floor<days>(time);
    const year_month_day date{sys_days{day}};
    const hh_mm_ss clock{time - day};
    const std::size_t at = tail_ + layout_.tail.date;
    put(at, static_cast<std::uint64_t>(static_cast<int>(date.year()) - year_zero), 1);
    put(at + 1, static_cast<unsigned>(date.month()), 1);
    put(at + 2, static_cast<unsigned>(date.day()), 1);
    put(at + 3, static_cast<std::uint64_t>(clock.hours().count()), 1);
    put(at + 4, static_cast<std::uint64_t>(clock.minutes().count()), 1);
    put(at + 5, static_cast<std::uint64_t>(clock.seconds().count()), 1);
    set_microseconds(static_cast<std::uint32_t>(duration_cast<microseconds>(clock.subseconds()).count()));
  }
  void set_date_byte(std::size_t i, std::uint8_t value) { put(tail_ + layout_.tail.date + i, value, 1); }
  void set_microseconds(std::uint32_t us) { put(tail_ + layout_.tail.time, us, 4); }
  void set_motor_speed(std::uint16_t rpm) { put(tail_ + layout_.tail.motor_speed, rpm, 2); }
  void set_return_mode(std::uint8_t mode) { put(tail_ + layout_.tail.return_mode, mode, 1); }
  void set_number(std::uint32_t number) { put(tail_ + layout_.tail.bytes, number, 4); }
  void set_mode_flag(std::uint8_t flag) { put(tail_ + 5, flag, 1); }
  void set_operational_state(std::uint8_t state) { put(tail_ + 11, state, 1); }
  void set_byte(std::size_t at, std::uint8_t value) { put(at, value, 1); }
  /// Omits the sequence number; for models without checksums, so do not call seal() afterwards.
  void leave_out_number() { bytes_.resize(bytes_.size() - 4); }

  /// Updates the checksums, if there are any.
  void seal() {
    if (!layout_.has_checksums)
      return;
    const std::span<const std::byte> all = bytes_;
    const std::size_t body = layout_.body(), end = bytes_.size() - 4;
    put(body, hesai::crc32(all.subspan(layout_.header, body - layout_.header)), 4);
    put(end, hesai::crc32(all.subspan(tail_, end - tail_)), 4);
  }

  [[nodiscard]] std::span<const std::byte> payload() const { return bytes_; }
  [[nodiscard]] std::size_t tail() const { return tail_; }

 private:
  [[nodiscard]] std::size_t at_block(std::size_t block) const { return layout_.header + block * layout_.block(); }
  void put(std::size_t at, std::uint64_t value, std::size_t count) { put_little_endian(&bytes_[at], value, count); }

  hesai::PacketLayout layout_;
  std::size_t tail_;
  std::vector<std::byte> bytes_;
};

} // namespace locus::sim
