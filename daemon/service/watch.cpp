// SPDX-License-Identifier: Apache-2.0
#include "daemon/service/watch.hpp"

#include <algorithm>

#include <fmt/format.h>
#include <systemd/sd-daemon.h>

#include "daemon/machine_time.hpp"
#include "daemon/service/lidar_sockets.hpp"

namespace locus::daemon {

void Watch::look() {
  const RosLink::Status link = session_.link().status();
  look_at_link(link);
  look_at_intruders(link);
  if (session_.age() > kPatience) {
    if (link.connected)
      look_at_sources(link);
    look_at_lidars();
  }
  look_at_drops();
  if (const auto recording = session_.recording())
    look_at_recording(*recording);
  if (const Duration now = read_clock(CLOCK_MONOTONIC); now - joined_ > kPatience) {
    join_multicast(session_.config(), session_.input().sockets());
    joined_ = now;
  }
}

void Watch::look_at_link(const RosLink::Status& link) {
  if (link.connected && !was_connected_)
    log_.info(fmt::format("DDS is up: domain {} on interface {}", session_.config().dds.domain,
                          session_.config().dds.interface));
  else if (!link.connected && link.attempts != told_attempts_)
    log_.warn(fmt::format("{}; trying again", link.problem), {{"LOCUS_ATTEMPT", std::to_string(link.attempts)}});
  was_connected_ = link.connected;
  told_attempts_ = link.attempts;
}

void Watch::look_at_sources(const RosLink::Status& link) {
  const Config& config = session_.config();
  for (std::size_t i = 0; i < link.sources.size(); ++i) {
    const std::string& name = config.odometry.motion_sources[i].name;
    const std::string& topic = config.source_topics[i].topic;
    if (topic.empty() || link.sources[i].received > 0 || !unheard_.insert(name).second)
      continue;
    const std::string found =
        link.sources[i].writers == 0
            ? fmt::format("nobody is seen that publishes {}; DDS listens on interface {} in domain {}, to change with "
                          "dds.interface and dds.domain",
                          topic, config.dds.interface, config.dds.domain)
            : fmt::format("{} of DDS on interface {} has {} publishers, but none has sent anything", topic,
                          config.dds.interface, link.sources[i].writers);
    log_.warn(fmt::format("motion source {}: not heard since the start, {} s ago: {}", name,
                          kPatience.count() / 1'000'000'000, found),
              {{"LOCUS_SOURCE", name}});
  }
}

void Watch::look_at_lidars() {
  const IngestReport ingest = session_.figures().snapshot().ingest;
  const std::vector<LidarOptions>& lidars = session_.config().lidars;
  for (std::size_t i = 0; i < lidars.size(); ++i) {
    const PacketCounters& packets = ingest.lidars[i].packets;
    if (packets.data > 0 || !unheard_.insert(lidars[i].name).second)
      continue;
    const std::string found =
        packets.received == 0
            ? "look at its power and cable, and where it sends to (locusctl sensors)"
            : "datagrams come, but none is a data packet of a lidar that is known; locusctl status says why";
    log_.warn(fmt::format("lidar {}: no data packet on UDP port {} since the start; {}", lidars[i].name, lidars[i].port,
                          found),
              {{"LOCUS_LIDAR", lidars[i].name}});
  }
}

void Watch::look_at_drops() {
  const std::uint64_t drops = session_.input().kernel_drops();
  if (drops != kernel_drops_)
    log_.warn(fmt::format("the kernel threw away {} lidar packets, for their buffer was full; sysctl "
                          "net.core.rmem_max={}, or a higher realtime.priority",
                          drops - kernel_drops_, UdpSocket::kWantedBufferBytes));
  kernel_drops_ = drops;
  const std::uint64_t filtered = session_.input().filtered();
  if (filtered != filtered_)
    log_.warn(
        fmt::format("the ports of the lidars are flooded: the kernel has kept out {} datagrams that are no lidar's "
                    "by length or sender; tcpdump shows whose, docs/security.md what to set against them",
                    filtered - filtered_));
  filtered_ = filtered;
}

void Watch::look_at_intruders(const RosLink::Status& link) {
  for (std::size_t i = 0; i < link.sources.size(); ++i) {
    const std::string& name = session_.config().odometry.motion_sources[i].name;
    if (link.sources[i].refused > 0 && intruded_.insert(name).second)
      log_.warn(
          fmt::format("motion source {}: samples on {} are refused, for another publishes there, too, or more come "
                      "than any sensor sends; give each publisher a topic of its own",
                      name, session_.config().source_topics[i].topic),
          {{"LOCUS_SOURCE", name}});
  }
}

/// What is dropped while the disk takes nothing goes without saying.
void Watch::look_at_recording(const Recorder::Status& recording) {
  const std::uint64_t dropped = recording.dropped - std::min(recording.dropped, recording_.dropped);
  if (recording_.problem.empty() && !recording.problem.empty())
    log_.error(fmt::format("{}; the odometry goes on without a recording", recording.problem));
  else if (recording.run != recording_.run || (!recording_.problem.empty() && recording.problem.empty()))
    log_.info(fmt::format("recording to {}", recording.run.string()));
  else if (recording.problem.empty() && dropped > 0)
    log_.warn(
        fmt::format("{} inputs were not recorded, for the disk is too slow; see record in locusd.yaml(5)", dropped));
  recording_ = recording;
}

Watchdog::Watchdog() {
  std::uint64_t period_us = 0;
  if (sd_watchdog_enabled(0, &period_us) > 0)
    period_ = std::chrono::microseconds{period_us / 3};
}

void Watchdog::look(const Session& session) {
  const Duration now = read_clock(CLOCK_MONOTONIC);
  if (period_ == Duration::zero() || now - fed_ < period_)
    return;
  const Session::Progress progress = session.progress();
  const bool all_go_on =
      !last_ || (progress.live.ingest != last_->live.ingest && progress.live.odometry != last_->live.odometry &&
                 progress.publisher != last_->publisher && progress.dds != last_->dds);
  if (!all_go_on)
    return;
  sd_notify(0, "WATCHDOG=1");
  fed_ = now;
  last_ = progress;
}

} // namespace locus::daemon
