// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/bag_packets.hpp"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

namespace locus::tools {
namespace {

constexpr Duration kAhead = std::chrono::milliseconds{500};

} // namespace

BagPackets::BagPackets(std::unique_ptr<Bag> bag, std::filesystem::path file, const Config& config,
                       const std::vector<std::optional<std::size_t>>& topic_of_lidar)
    : bag_(std::move(bag)), file_(std::move(file)) {
  for (std::size_t i = 0; i < topic_of_lidar.size(); ++i) {
    if (topic_of_lidar[i])
      lidars_.push_back({*topic_of_lidar[i], config.lidars[i].port, config.lidars[i].source_ip.value_or(0)});
  }
}

const Datagram* BagPackets::next() {
  read_ahead();
  const auto earliest = std::ranges::min_element(scans_, {}, &Scan::stamp);
  if (earliest == scans_.end())
    return nullptr;
  packet_ = earliest->packets[earliest->next++];
  datagram_ = {packet_.payload,       earliest->lidar->ip, earliest->lidar->port,
               earliest->lidar->port, packet_.stamp,       false};
  if (earliest->next == earliest->packets.size())
    scans_.erase(earliest);
  --waiting_;
  ++datagrams_;
  return &datagram_;
}

void BagPackets::read_ahead() {
  constexpr std::size_t kMaxWaiting = 30'000; // what sixteen lidars send in that time, and 40 MB
  const auto is_ahead = [&] {
    return !scans_.empty() &&
           (std::chrono::abs(newest_ - scans_.front().recorded) >= kAhead || waiting_ >= kMaxWaiting);
  };
  while (!bag_is_over_ && !is_ahead()) {
    const BagMessage* message = bag_->next();
    bag_is_over_ = message == nullptr;
    if (message != nullptr)
      take(*message);
  }
}

void BagPackets::take(const BagMessage& message) {
  misplaced_ += message.recorded < newest_ - kAhead ? 1U : 0U;
  newest_ = message.recorded;
  const auto lidar = std::ranges::find(lidars_, message.topic, &Lidar::topic);
  if (lidar == lidars_.end())
    return;
  ++messages_;
  std::optional<VelodyneScan> scan = read_velodyne_scan({message.data, bag_->serialisation()});
  malformed_ += scan ? 0U : 1U;
  if (!scan || scan->packets.empty())
    return;
  for (VelodyneScan::Packet& packet : scan->packets)
    packet.stamp = stamp_or(message.recorded, packet.stamp);
  waiting_ += scan->packets.size();
  scans_.push_back({&*lidar, message.recorded, std::move(scan->packets)});
}

std::string BagPackets::why_none() const {
  return fmt::format("no whole packet in {} messages of type {}; record the topic of the lidar's driver, mostly "
                     "/velodyne_packets",
                     messages_, kVelodyneScanType);
}

std::vector<std::string> BagPackets::warnings() const {
  std::vector<std::string> lines = bag_->warnings();
  if (misplaced_ > 0)
    lines.push_back(fmt::format("{}: the time of reception goes back {} times from one message to the next: the "
                                "recorder's clock was set, or the bag is not in order, and what was made of it is "
                                "wrong; sort it with: rosbag filter BAG SORTED_BAG True",
                                file_.string(), misplaced_));
  if (malformed_ > 0)
    lines.push_back(
        fmt::format("{}: {} of {} messages of type {} are cut short, or not serialised as little-endian, and "
                    "were left out; record again if it matters",
                    file_.string(), malformed_, messages_, kVelodyneScanType));
  return lines;
}

} // namespace locus::tools
