// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/base/expected.hpp"
#include "drivers/lidar_input.hpp"

namespace locus {

/// Routes each datagram to its lidar, by destination port and source address. Single owner, not thread-safe.
class LidarRouter {
 public:
  /// Opens all lidars. Fails with one line for the user.
  static Expected<LidarRouter, std::string> open(const std::vector<LidarOptions>& options);

  /// Processes a datagram. Returns the packet decoded from it (LidarPacket::lidar is the index of the lidar), valid
  /// until the next call, or nullptr if there is none.
  const LidarPacket* receive(const Datagram& datagram);

  [[nodiscard]] const std::vector<LidarInput>& lidars() const { return lidars_; }

  /// Index of the lidar that processed the latest datagram; empty if it matched none.
  [[nodiscard]] std::optional<std::size_t> latest() const { return latest_; }

  /// IMU samples of the latest datagram, see LidarInput::imu_samples().
  struct Imu {
    std::uint8_t lidar = 0; ///< index
    std::span<const ImuSample> samples;
  };
  [[nodiscard]] Imu imu() const {
    return latest_ ? Imu{static_cast<std::uint8_t>(*latest_), lidars_[*latest_].imu_samples()} : Imu{};
  }

  /// Lidar to which the configuration alone assigns a datagram, whether or not that lidar has sent anything yet.
  struct Origin {
    std::string_view lidar;                     ///< name of the lidar; empty if none matches
    const ouster::Metadata* metadata = nullptr; ///< Ouster only, otherwise nullptr
  };
  /// Finds the configured lidar of a datagram. The result refers to data that lives as long as the router.
  [[nodiscard]] Origin configured_for(const Datagram& datagram) const;

  /// Addresses of senders, host byte order (empty: any sender is possible), and the lengths of lidar packets in bytes.
  struct Senders {
    static constexpr std::size_t kMax = 16;
    std::array<std::uint32_t, kMax> ips{};
    std::size_t count = 0;
    static constexpr std::size_t kMaxLengths = 2 * kMax + std::tuple_size_v<decltype(PacketLengths::storage)>;
    std::array<std::size_t, kMaxLengths> lengths{velodyne::kDataPacketBytes, velodyne::kPositionPacketBytes};
    std::size_t length_count = 2;

    void add_lengths(std::span<const std::size_t> more);

    [[nodiscard]] std::span<const std::uint32_t> all() const { return {ips.data(), count}; }
    [[nodiscard]] std::span<const std::size_t> all_lengths() const { return {lengths.data(), length_count}; }
    bool operator==(const Senders&) const = default;
  };

  /// Returns the senders of the lidars that listen to `port`; without addresses while one of these lidars has none,
  /// configured or learnt.
  [[nodiscard]] Senders senders_to(std::uint16_t port) const;

  /// Sum over all lidars and over the datagrams that match none of them (rejected as sender).
  [[nodiscard]] PacketCounters total() const;

 private:
  explicit LidarRouter(std::vector<LidarInput> lidars) : lidars_(std::move(lidars)) {}
  LidarInput* find(const Datagram& datagram);

  std::vector<LidarInput> lidars_;
  std::optional<std::size_t> latest_; ///< index of the lidar that sent the last datagram; empty if none matched
  PacketCounters foreign_;
};

} // namespace locus
