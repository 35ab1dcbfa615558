// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "bags/bag.hpp"
#include "bags/messages.hpp"
#include "config/config.hpp"
#include "drivers/clouds/cloud_view.hpp"
#include "drivers/net/datagram.hpp"
#include "locus_replay/bag_topics.hpp"
#include "locus_replay/driver_stamps.hpp"

namespace locus::tools {

/// Converts the packets in a bag back to datagrams: to the port and from the address configured for their lidar,
/// received at the driver's stamp (DriverStamps). Clouds are received at the recorder's stamp.
///
/// Uses the first of several lidars on one topic, which differ in frame_id; another replaces it only after a second of
/// silence.
///
/// A message holds the packets of a whole turn. To sort those of several lidars by reception, messages are read half a
/// second ahead. One owner.
class BagPackets : public DatagramSource {
 public:
  /// Takes the bag at its first message. `recorder_ahead` of the driver of each lidar, by configuration index.
  BagPackets(std::unique_ptr<Bag> bag, std::filesystem::path file, const Config& config, const BagTopics& topics,
             const std::vector<std::optional<Duration>>& recorder_ahead);

  const Datagram* next() override;
  [[nodiscard]] std::uint64_t datagrams() const override { return datagrams_; }
  [[nodiscard]] std::string why_none() const override;
  [[nodiscard]] std::vector<std::string> warnings() const override;
  [[nodiscard]] double progress() const override { return bag_->progress(); }

 private:
  /// Lidar, or the IMU in it, whose packets have a topic of their own.
  struct Lidar {
    std::uint8_t index;
    std::size_t topic;
    std::string type;          ///< of the messages
    const PacketType* packets; ///< message type; nullptr: clouds
    std::uint16_t port;
    std::uint32_t ip;
    DriverStamps stamps;
    std::optional<Duration> clock{};    ///< of the latest packet, by the lidar (packet_clock.hpp)
    Stamp latest{};                     ///< of the latest packet; recording time of the latest cloud
    std::optional<std::string> frame{}; ///< frame_id in use
    Stamp frame_seen{};                 ///< recording time of its latest message
    std::string other_frame{};          ///< latest one that was left out
    std::uint64_t of_other_frame = 0;   ///< messages left out
  };
  struct Scan {
    const Lidar* lidar;
    Stamp recorded;
    LidarPackets packets;
    std::vector<std::byte> cloud; ///< message with a cloud; replaces the packets
    bool clock_was_set_back;      ///< before it
    std::size_t next = 0;         ///< index of the next packet, below their number

    [[nodiscard]] bool is_cloud() const { return packets.packets.empty(); }
    [[nodiscard]] const LidarPackets::Packet& packet() const { return packets.packets[next]; }
    [[nodiscard]] Stamp stamp() const { return is_cloud() ? recorded : packet().stamp; }
  };

  void read_ahead();
  static bool continues(const LidarPackets& packets, Lidar& lidar);
  void judge_order(const BagMessage& message, bool message_continues);
  void add(std::size_t topic, std::size_t lidar, const LidarOptions& options, std::uint16_t port,
           std::optional<Duration> recorder_ahead);
  void accept(const BagMessage& message);
  void accept_packets(const BagMessage& message, Lidar& lidar);
  static bool is_of_used_frame(const std::string& frame, Stamp recorded, Lidar& lidar);
  void accept_cloud(const BagMessage& message, Lidar& lidar);
  void emit_packet(const Scan& scan);
  void emit_cloud(Scan& scan);
  void add_warnings_of_topics(std::vector<std::string>& lines) const;
  [[nodiscard]] std::string types() const;

  std::unique_ptr<Bag> bag_;
  std::filesystem::path file_;
  std::vector<Lidar> lidars_;
  std::deque<Scan> scans_;  ///< read but not returned yet; in file order
  std::size_t waiting_ = 0; ///< bytes of memory in use for them
  Stamp newest_;            ///< recording time of the preceding message
  Stamp latest_;            ///< latest recording time so far
  bool bag_is_over_ = false;
  std::vector<std::byte> bytes_; ///< of the datagram returned
  CloudView cloud_;
  Datagram datagram_;
  std::uint64_t datagrams_ = 0, messages_ = 0, malformed_ = 0;
  std::uint64_t misplaced_ = 0; ///< messages received well before one that precedes them in the file
  std::uint64_t undecided_ = 0; ///< the same since the latest lidar message: the recorder's clock may have been set
};

} // namespace locus::tools
