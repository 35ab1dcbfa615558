// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/bag_packets.hpp"

#include <algorithm>
#include <set>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "bags/reception_order.hpp"
#include "drivers/packet_clock.hpp"

namespace locus::tools {
namespace {

constexpr Duration kAhead = std::chrono::milliseconds{500};
constexpr std::size_t kWithEach = 100; ///< bytes of overhead per packet or cloud: many may be empty

} // namespace

BagPackets::BagPackets(std::unique_ptr<Bag> bag, std::filesystem::path file, const Config& config,
                       const BagTopics& topics, const std::vector<std::optional<Duration>>& recorder_ahead)
    : bag_(std::move(bag)), file_(std::move(file)) {
  for (std::size_t i = 0; i < config.lidars.size(); ++i) {
    const LidarOptions& lidar = config.lidars[i];
    if (topics.of_lidar[i])
      add(*topics.of_lidar[i], i, lidar, lidar.port, recorder_ahead[i]);
    if (topics.of_imu[i])
      add(*topics.of_imu[i], i, lidar, lidar.imu_port, recorder_ahead[i]);
  }
}

void BagPackets::add(std::size_t topic, std::size_t lidar, const LidarOptions& options, std::uint16_t port,
                     std::optional<Duration> recorder_ahead) {
  const std::string& type = bag_->topics()[topic].type;
  lidars_.push_back({static_cast<std::uint8_t>(lidar), topic, type, packet_type(type), port,
                     options.source_ip.value_or(0), DriverStamps(recorder_ahead)});
}

const Datagram* BagPackets::next() {
  read_ahead();
  if (scans_.empty())
    return nullptr;
  const auto set_back = std::find_if( // by the recorder's clock; what follows is later
      std::next(scans_.begin()), scans_.end(),
      [&](const Scan& scan) { return scan.clock_was_set_back || scan.recorded < scans_.front().recorded - kAhead; });
  const auto earliest = std::ranges::min_element(scans_.begin(), set_back, {}, &Scan::stamp);
  if (earliest->is_cloud())
    emit_cloud(*earliest);
  else
    emit_packet(*earliest);
  waiting_ -= bytes_.size() + kWithEach;
  if (++earliest->next >= earliest->packets.packets.size())
    scans_.erase(earliest);
  ++datagrams_;
  return &datagram_;
}

void BagPackets::emit_packet(const Scan& scan) {
  const auto payload = scan.packets.payload(scan.packet());
  bytes_.assign(payload.begin(), payload.end());
  datagram_ = {bytes_, scan.lidar->ip, scan.lidar->port, scan.lidar->port, scan.stamp(), false};
}

void BagPackets::emit_cloud(Scan& scan) {
  bytes_ = std::move(scan.cloud);
  const Serialisation serialisation = bag_->topics()[scan.lidar->topic].serialisation;
  cloud_ = read_cloud({bytes_, serialisation}, scan.lidar->type).value_or(CloudView{});
  datagram_ = {};
  datagram_.receive_stamp = scan.recorded;
  datagram_.cloud = &cloud_;
  datagram_.lidar = scan.lidar->index;
}

void BagPackets::read_ahead() {
  constexpr std::size_t kMaxWaiting = 40'000'000; // bytes: the packets of sixteen lidars in that time
  constexpr std::size_t kMaxScans = 10'000;       // bounds the search for the earliest at each packet
  const auto is_ahead = [&] {
    return !scans_.empty() && (std::chrono::abs(newest_ - scans_.front().recorded) >= kAhead ||
                               waiting_ >= kMaxWaiting || scans_.size() >= kMaxScans);
  };
  while (!bag_is_over_ && !is_ahead()) {
    const BagMessage* message = bag_->next();
    bag_is_over_ = message == nullptr;
    if (message != nullptr)
      accept(*message);
  }
}

void BagPackets::accept(const BagMessage& message) {
  undecided_ += message.recorded < latest_ - kAhead ? 1U : 0U;
  latest_ = std::max(latest_, message.recorded);
  newest_ = message.recorded;
  const auto lidar = std::ranges::find(lidars_, message.topic, &Lidar::topic);
  if (lidar == lidars_.end())
    return;
  ++messages_;
  if (lidar->packets == nullptr)
    accept_cloud(message, *lidar);
  else
    accept_packets(message, *lidar);
}

void BagPackets::accept_cloud(const BagMessage& message, Lidar& lidar) {
  if (!read_cloud({message.data, bag_->topics()[message.topic].serialisation}, lidar.type)) {
    ++malformed_;
    return;
  }
  waiting_ += message.data.size() + kWithEach;
  const bool clock_was_set_back = message.recorded <= lidar.latest - kLeastStepBack;
  judge_order(message, clock_was_set_back);
  lidar.latest = message.recorded;
  scans_.push_back({&lidar, message.recorded, {}, {message.data.begin(), message.data.end()}, clock_was_set_back});
}

void BagPackets::accept_packets(const BagMessage& message, Lidar& lidar) {
  const Serialisation serialisation = bag_->topics()[message.topic].serialisation;
  std::optional<LidarPackets> packets = lidar.packets->read({message.data, serialisation});
  malformed_ += packets ? 0U : 1U;
  if (!packets || packets->packets.empty() || !is_of_used_frame(packets->frame, message.recorded, lidar))
    return;
  const bool lidar_continues = continues(*packets, lidar);
  judge_order(message, lidar_continues);
  lidar.stamps.correct(*packets, message.recorded);
  const bool clock_was_set_back = lidar_continues && packets->packets.front().stamp <= lidar.latest - kLeastStepBack;
  lidar.latest = packets->packets.back().stamp;
  waiting_ += packets->bytes.size() + kWithEach * packets->packets.size();
  scans_.push_back({&lidar, message.recorded, *std::move(packets), {}, clock_was_set_back});
}

/// Returns whether the packets follow those of the lidar's previous message, by its own clock.
bool BagPackets::continues(const LidarPackets& packets, Lidar& lidar) {
  constexpr Duration kLongestPause = std::chrono::seconds{1};
  const auto first = clock_in(packets.payload(packets.packets.front()), nullptr);
  const Duration advance = first && lidar.clock ? clock_advance(*lidar.clock, *first) : Duration{};
  lidar.clock = clock_in(packets.payload(packets.packets.back()), nullptr);
  return advance > Duration{} && advance < kLongestPause;
}

/// Decides whether messages are misplaced, or the recorder's clock was set back, so that this message continues.
void BagPackets::judge_order(const BagMessage& message, bool message_continues) {
  if (undecided_ == 0)
    return;
  if (message_continues)
    latest_ = message.recorded;
  else
    misplaced_ += undecided_;
  undecided_ = 0;
}

bool BagPackets::is_of_used_frame(const std::string& frame, Stamp recorded, Lidar& lidar) {
  constexpr Duration kSilence = std::chrono::seconds{1};
  if (frame == lidar.frame.value_or(frame) || recorded - lidar.frame_seen > kSilence) {
    lidar.frame = frame;
    lidar.frame_seen = recorded;
    return true;
  }
  lidar.other_frame = frame;
  ++lidar.of_other_frame;
  return false;
}

std::string BagPackets::why_none() const {
  return fmt::format("no whole packet or cloud in {} messages of type {}; record the topic of the lidar's driver, "
                     "mostly /velodyne_packets",
                     messages_, types());
}

std::vector<std::string> BagPackets::warnings() const {
  std::vector<std::string> lines = bag_->warnings();
  if (misplaced_ + undecided_ > 0)
    lines.push_back(fmt::format("{}: {} messages follow one that was received later: the recorder's clock was "
                                "set, or the bag is not in order, and the results are wrong; sort it with: "
                                "rosbag filter BAG SORTED_BAG True, or mcap sort BAG -o SORTED_BAG",
                                file_.string(), misplaced_ + undecided_));
  if (malformed_ > 0)
    lines.push_back(
        fmt::format("{}: {} of {} messages of type {} are truncated, or not serialised as little-endian, and "
                    "were skipped; record again if they matter",
                    file_.string(), malformed_, messages_, types()));
  add_warnings_of_topics(lines);
  return lines;
}

/// Adds a line for each topic whose stamps were replaced, or that several lidars share.
void BagPackets::add_warnings_of_topics(std::vector<std::string>& lines) const {
  for (const Lidar& lidar : lidars_) {
    const std::string& topic = bag_->topics()[lidar.topic].name;
    if (lidar.stamps.replaced() > 0)
      lines.push_back(fmt::format("{}: {}: the stamps of the packets in {} messages are constant, zero or absurd: the "
                                  "times at which the bag was recorded are used instead",
                                  file_.string(), topic, lidar.stamps.replaced()));
    if (lidar.of_other_frame > 0)
      lines.push_back(fmt::format("{}: {}: several lidars publish on it: frame_id {} is used, {} messages "
                                  "of {} are not; give each driver its own namespace, and record again",
                                  file_.string(), topic, *lidar.frame, lidar.of_other_frame, lidar.other_frame));
  }
}

/// Lists the message types of all lidars.
std::string BagPackets::types() const {
  std::set<std::string_view> types;
  for (const Lidar& lidar : lidars_)
    types.insert(lidar.type);
  return fmt::format("{}", fmt::join(types, ", "));
}

} // namespace locus::tools
