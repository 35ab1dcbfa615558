// SPDX-License-Identifier: Apache-2.0
#include "daemon/service/watch.hpp"

#include <algorithm>

#include <fmt/format.h>
#include <systemd/sd-daemon.h>

#include "daemon/machine_time.hpp"
#include "daemon/service/lidar_sockets.hpp"
#include "drivers/net/ip_address.hpp"

namespace locus::daemon {

void Watch::look() {
  const RosLink::Status link = session_.link().status();
  look_at_link(link);
  look_at_intruders(link);
  if (session_.age() > kPatience && link.connected)
    look_at_sources(link);
  look_at_lidars();
  look_at_verdicts();
  look_at_load();
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
    const std::string& name = config.motion_sources[i].name;
    const std::string& topic = config.motion_sources[i].topic;
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
  const Duration now = read_clock(CLOCK_MONOTONIC);
  for (std::size_t i = 0; i < lidars.size(); ++i) {
    const PacketCounters& packets = ingest.lidars[i].packets;
    Lidar& lidar = lidars_[i];
    const bool heard = packets.data > lidar.data;
    if (packets.data != lidar.data || lidar.heard == Duration::zero()) { // fewer: the counters began anew
      if (heard && !lidar.told.empty())
        log_.info(fmt::format("lidar {}: heard", lidars[i].name), {{"LOCUS_LIDAR", lidars[i].name}});
      lidar = {.data = packets.data,
               .received = packets.received,
               .heard = now,
               .told = {},
               .short_sweep_told = lidar.short_sweep_told,
               .shared_port_told = lidar.shared_port_told};
    }
    const auto warning = short_sweep(session_.config().sweep, lidars[i].name, ingest.lidars[i].rotation_rate_rpm);
    if (warning && !std::exchange(lidar.short_sweep_told, true))
      log_.warn(*warning, {{"LOCUS_LIDAR", lidars[i].name}});
    const auto shared = session_.age() > kPatience ? shared_port(lidars[i], ingest.lidars[i]) : std::nullopt;
    if (shared && !std::exchange(lidar.shared_port_told, true))
      log_.warn(*shared, {{"LOCUS_LIDAR", lidars[i].name}});
    if (now - lidar.heard < kPatience)
      continue;
    const std::string why = why_silent(lidar, lidars[i], ingest.lidars[i]);
    if (why == lidar.told)
      continue;
    lidar.told = why;
    log_.warn(fmt::format("lidar {}: no data packet on UDP port {} for {} s; {}", lidars[i].name, lidars[i].port,
                          std::chrono::duration_cast<std::chrono::seconds>(now - lidar.heard).count(), why),
              {{"LOCUS_LIDAR", lidars[i].name}});
  }
}

std::string Watch::why_silent(const Lidar& lidar, const LidarOptions& options, const IngestReport::Lidar& now) {
  const PacketCounters& packets = now.packets;
  if (packets.received == lidar.received)
    return "look at its power and cable, and where it sends to (locusctl sensors)";
  if (packets[PacketError::sender] > 0 && now.refused_ip && now.source_ip)
    return fmt::format("packets come from {}, {} {}: set lidars.{}.source_ip to that of the lidar",
                       dotted(*now.refused_ip), options.source_ip ? "configured is" : "the lidar was",
                       dotted(*now.source_ip), options.name);
  if (packets.data + packets.position == packets.received)
    return fmt::format("its position packets come, so it is on and sends the others elsewhere: locusctl sensors tells "
                       "to which port, for lidars.{}.port",
                       options.name);
  const std::string unknown =
      now.unknown_packets ? fmt::format(" ({})", velodyne::to_string(*now.unknown_packets)) : "";
  return fmt::format("what comes is refused, for the reasons that locusctl status counts{}: is it a Velodyne, and "
                     "lidars.{}.model the right one?",
                     unknown, options.name);
}

/// What a check has found wrong with a source that goes on being used in part. Of one that is lost, its loss tells.
void Watch::look_at_verdicts() {
  const IngestReport ingest = session_.figures().snapshot().ingest;
  const auto& sources = session_.config().motion_sources;
  for (std::size_t i = 0; i < sources.size(); ++i) {
    const std::string_view verdict = ingest.sources[i].healthy ? ingest.sources[i].verdict : std::string_view{};
    if (!verdict.empty() && verdict != verdicts_[i])
      log_.warn(fmt::format("motion source {} {}", sources[i].name, verdict), {{"LOCUS_SOURCE", sources[i].name}});
    verdicts_[i] = verdict;
  }
}

void Watch::look_at_load() {
  const Duration now = read_clock(CLOCK_MONOTONIC);
  if (now - weighed_ < kPatience)
    return;
  weighed_ = now;
  const std::uint64_t drops = session_.pipeline().counters().dropped;
  if (drops > sweep_drops_)
    log_.warn(fmt::format(
        "this computer is too busy: {} sweeps were dropped within {} s; see /usr/share/doc/locusd/tuning.md, and what "
        "else runs here",
        drops - sweep_drops_, std::chrono::duration_cast<std::chrono::seconds>(kPatience).count()));
  sweep_drops_ = drops;
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
    log_.warn(fmt::format(
        "the ports of the lidars are flooded: the kernel has kept out {} datagrams that are no lidar's "
        "by length or sender; tcpdump shows whose, /usr/share/doc/locusd/security.md what to set against them",
        filtered - filtered_));
  filtered_ = filtered;
}

void Watch::look_at_intruders(const RosLink::Status& link) {
  const Config& config = session_.config();
  const auto tell = [this](std::uint64_t refused, const std::string& topic, const std::string& source) {
    if (refused > 0 && intruded_.insert(topic).second)
      log_.warn(fmt::format("{}messages on {} are refused, for another publishes there, too, or more come than any "
                            "sensor sends; give each publisher a topic of its own",
                            source.empty() ? "" : "motion source " + source + ": ", topic),
                {{"LOCUS_SOURCE", source}});
  };
  for (std::size_t i = 0; i < link.sources.size(); ++i) {
    const MotionSource& source = config.motion_sources[i];
    tell(link.sources[i].refused, source.topic, source.name);
    tell(link.sources[i].health_refused, source.health_topic, source.name);
  }
  tell(link.flat_ground_refused, config.dds.flat_ground_topic, "");
}

/// What is dropped while the disk takes nothing goes without saying.
void Watch::look_at_recording(const Recorder::Status& recording) {
  const std::uint64_t dropped = recording.dropped - std::min(recording.dropped, recording_.dropped);
  if (recording_.problem.empty() && !recording.problem.empty())
    log_.error(fmt::format("{}; the odometry goes on without a recording", recording.problem));
  else if (!recording.run.empty() &&
           (recording.run != recording_.run || (!recording_.problem.empty() && recording.problem.empty())))
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
