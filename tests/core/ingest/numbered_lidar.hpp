// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/ingest/sweep_builder.hpp"

namespace locus::test {

inline constexpr Stamp kStart = stamp_from_ns(1'700'000'000'000'000'000);
inline constexpr Duration kColumn = std::chrono::nanoseconds{55'296};
inline constexpr Duration kLaser = std::chrono::nanoseconds{2'304};
inline constexpr int kColumns = 24;
inline constexpr Duration kPacket = kColumns * kColumn;

/// A lidar with identifiable returns: x is the return's number. Records the firing time of each.
class NumberedLidar {
 public:
  explicit NumberedLidar(std::uint8_t index = 0, double rpm = 600, double first_azimuth_deg = 0, Stamp start = kStart)
      : index_(index), rpm_(rpm), azimuth_deg_(first_azimuth_deg), next_(start) {}

  LidarPacket packet() {
    LidarPacket packet;
    packet.lidar = index_;
    packet.stamp = next_;
    packet.duration = kPacket;
    packet.first_azimuth_cdeg = azimuth_cdeg(Duration{0});
    for (int column = 0; column < kColumns; ++column) {
      FiringGroup& group = packet.storage[packet.count++];
      group.y_m = group.z_m = {};
      group.range_m.fill(range_m_);
      group.intensity.fill(10);
      for (std::size_t laser = 0; laser < FiringGroup::kLasers; ++laser) {
        const Duration offset = column * kColumn + static_cast<int>(laser) * kLaser;
        group.x_m[laser] = static_cast<float>(fired_.size());
        group.offset_ns[laser] = static_cast<std::int32_t>(offset.count());
        group.ring[laser] = static_cast<std::uint8_t>(laser);
        fired_.push_back(next_ + offset);
      }
    }
    skip(kPacket);
    return packet;
  }

  void skip(Duration time) {
    azimuth_deg_ = std::fmod(azimuth_deg_ + 6.0 * rpm_ * to_seconds(time), 360.0);
    next_ += time;
  }
  void jump(Duration by) { next_ += by; } ///< steps only this lidar's clock
  void set_range_m(float range_m) { range_m_ = range_m; }

  [[nodiscard]] Stamp next() const { return next_; }
  [[nodiscard]] Stamp fired(std::size_t number) const { return fired_[number]; }
  [[nodiscard]] std::size_t count() const { return fired_.size(); }

 private:
  [[nodiscard]] std::uint16_t azimuth_cdeg(Duration since_packet) const {
    const double turned_deg = azimuth_deg_ + 6.0 * rpm_ * to_seconds(since_packet);
    return static_cast<std::uint16_t>(static_cast<int>(100.0 * turned_deg) % 36000);
  }

  std::uint8_t index_;
  double rpm_;
  double azimuth_deg_;
  float range_m_ = 5.0F;
  Stamp next_;
  std::vector<Stamp> fired_;
};

inline SweepOptions keep_all() {
  SweepOptions options;
  options.segment_filter.enabled = false;
  return options;
}

/// A builder that stores its sweeps.
class Built {
 public:
  static constexpr std::size_t kMaxReturns = 60'000; ///< upper bound of two lidars at 300 rpm

  explicit Built(const SweepOptions& options = keep_all(), std::size_t lidars = 1,
                 const std::vector<MotionSourceOptions>& sources = {}, std::size_t max_returns = kMaxReturns)
      : builder(options, std::vector<Pose>(lidars), MotionSources(sources, Fusion::combined), max_returns,
                [this](Sweep& sweep) { sweeps.push_back(sweep); }) {}

  void add(const LidarPacket& packet) { builder.add(packet, packet.stamp + packet.duration); }
  void play(NumberedLidar& lidar, Duration duration) {
    for (const Stamp end = lidar.next() + duration; lidar.next() < end;)
      add(lidar.packet());
  }

  std::vector<Sweep> sweeps;
  SweepBuilder builder;
};

inline std::size_t number_of(const SweepPoint& point) {
  return static_cast<std::size_t>(std::lround(point.position_base_m.x()));
}

} // namespace locus::test
