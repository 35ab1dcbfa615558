// SPDX-License-Identifier: Apache-2.0
#include "daemon/service/status.hpp"

#include <algorithm>
#include <ctime>
#include <utility>

#include <fmt/format.h>
#include <systemd/sd-daemon.h>

#include "daemon/calibration.hpp"
#include "daemon/dds/dds_node.hpp"
#include "daemon/dds/diagnostics.hpp"
#include "daemon/machine_time.hpp"
#include "daemon/service/machine.hpp"
#include "drivers/net/datagram.hpp"

namespace locus::daemon {

std::string status_line(const Figures& figures) {
  const SweepFigures& sweeps = figures.sweeps;
  if (!sweeps.last || read_clock(CLOCK_MONOTONIC) - sweeps.last_at > kStale)
    return figures.ingest.total.received == 0 && !figures.ingest.has_lidar_data() ? "Waiting for the first lidar packet"
                                                                                  : "Waiting for lidar data";
  return fmt::format("{}, {:.1f} Hz, {:.1f} ms a sweep, {} dropped", to_string(sweeps.last->state), sweeps.rate_hz,
                     sweeps.process_ms.p50, figures.counters.dropped);
}

void Watch::look(const Figures& figures) {
  const Figures::Live& live = *figures.live;
  look_at_link(live.link);
  look_at_intruders(live.link);
  if (figures.duration > kPatience && live.link.connected)
    look_at_sources(live.link);
  look_at_lidars(figures);
  look_at_verdicts(figures.ingest);
  look_at_calibration(figures);
  look_at_speed(figures.sweeps.largest_speed_mps);
  look_at_load(figures.counters);
  look_at_drops(live);
  if (live.recording)
    look_at_recording(*live.recording);
  if (const Duration now = clock_(CLOCK_MONOTONIC); now - joined_ > kPatience) {
    join_multicast(config_, sockets_);
    joined_ = now;
  }
}

void Watch::look_at_link(const LinkFigures& link) {
  if (link.connected && !was_connected_)
    log_.info(fmt::format("DDS is up: domain {} on interface {}", config_.dds.domain, config_.dds.interface));
  else if (!link.connected && link.attempts != told_attempts_)
    log_.warn(fmt::format("{}; trying again", link.problem), {{"LOCUS_ATTEMPT", std::to_string(link.attempts)}});
  was_connected_ = link.connected;
  told_attempts_ = link.attempts;
}

void Watch::look_at_sources(const LinkFigures& link) {
  for (std::size_t i = 0; i < link.sources.size(); ++i) {
    const std::string& name = config_.motion_sources[i].name;
    const std::string& topic = config_.motion_sources[i].topic;
    if (topic.empty() || link.sources[i].received > 0 || !unheard_.insert(name).second)
      continue;
    const std::string found =
        link.sources[i].writers == 0
            ? fmt::format("no publisher found for {}; DDS uses interface {}, domain {} (dds.interface, dds.domain)",
                          topic, config_.dds.interface, config_.dds.domain)
            : fmt::format("{} of DDS on interface {} has {} publishers, but none has sent anything", topic,
                          config_.dds.interface, link.sources[i].writers);
    log_.warn(fmt::format("motion source {}: not heard since the start, {} s ago: {}", name,
                          kPatience.count() / 1'000'000'000, found),
              {{"LOCUS_SOURCE", name}});
  }
}

void Watch::look_at_lidars(const Figures& figures) {
  const IngestReport& ingest = figures.ingest;
  const std::vector<LidarOptions>& lidars = figures.config.lidars;
  const Duration now = clock_(CLOCK_MONOTONIC);
  for (std::size_t i = 0; i < lidars.size(); ++i) {
    const std::uint64_t used = ingest.lidars[i].used();
    Lidar& lidar = lidars_[i];
    const bool heard = used > lidar.data;
    if (used != lidar.data || lidar.heard == Duration::zero()) { // fewer: the counters were reset
      if (heard && !lidar.told.empty())
        log_.info(fmt::format("lidar {}: heard", lidars[i].name), {{"LOCUS_LIDAR", lidars[i].name}});
      lidar = {.data = used,
               .received = ingest.lidars[i].received(),
               .heard = now,
               .told = {},
               .short_sweep_told = lidar.short_sweep_told,
               .shared_port_told = lidar.shared_port_told,
               .doubts_told = lidar.doubts_told,
               .unused_pps_told = std::move(lidar.unused_pps_told)};
    }
    const auto warning = short_sweep(figures.config.sweep, lidars[i].name, ingest.lidars[i].rotation_rate_rpm);
    if (warning && !std::exchange(lidar.short_sweep_told, true))
      log_.warn(*warning, {{"LOCUS_LIDAR", lidars[i].name}});
    const auto shared = figures.duration > kPatience ? shared_port(lidars[i], ingest.lidars[i]) : std::nullopt;
    if (shared && !std::exchange(lidar.shared_port_told, true))
      log_.warn(*shared, {{"LOCUS_LIDAR", lidars[i].name}});
    const auto unused = unused_pps(lidars[i], ingest.lidars[i]);
    if (unused && *unused != std::exchange(lidar.unused_pps_told, *unused))
      log_.warn(*unused, {{"LOCUS_LIDAR", lidars[i].name}});
    look_at_doubts(lidar, lidars[i], ingest.lidars[i]);
    if (now - lidar.heard < kPatience)
      continue;
    const std::string why = why_silent(lidar, lidars[i], ingest.lidars[i]);
    if (why == lidar.told)
      continue;
    lidar.told = why;
    const std::string what = lidars[i].gives_clouds() ? fmt::format("cloud on topic {}", lidars[i].topic)
                                                      : fmt::format("data packet on UDP port {}", lidars[i].port);
    log_.warn(fmt::format("lidar {}: no {} for {} s; {}", lidars[i].name, what,
                          std::chrono::duration_cast<std::chrono::seconds>(now - lidar.heard).count(), why),
              {{"LOCUS_LIDAR", lidars[i].name}});
  }
}

/// Logs each fault of a lidar's clouds once.
void Watch::look_at_doubts(Lidar& lidar, const LidarOptions& options, const IngestReport::Lidar& now) {
  const CloudDoubts doubts = now.clouds ? now.clouds->doubts : CloudDoubts{};
  if ((doubts & ~lidar.doubts_told).none())
    return;
  IngestReport::Lidar untold = now;
  untold.clouds->doubts &= ~lidar.doubts_told;
  lidar.doubts_told |= doubts;
  for (const std::string& line : cloud_doubts(options, untold))
    log_.warn(line, {{"LOCUS_LIDAR", options.name}});
}

std::string Watch::why_silent(const Lidar& lidar, const LidarOptions& options, const IngestReport::Lidar& now) {
  const PacketCounters& packets = now.packets;
  if (now.clouds)
    return now.received() == lidar.received
               ? "look whether its driver runs and publishes it in this domain, and whether DDS may use that interface"
               : "what comes is refused, for the reasons that locusctl status counts";
  if (packets.received == lidar.received)
    return "look at its power and cable, and where it sends to (locusctl sensors)";
  if (packets[PacketError::sender] > 0 && now.refused_ip && now.source_ip)
    return fmt::format("packets come from {}, {} {}: set lidars.{}.source_ip to that of the lidar",
                       dotted(*now.refused_ip), options.source_ip ? "configured is" : "the lidar was",
                       dotted(*now.source_ip), options.name);
  if (packets.data + packets.position == packets.received)
    return fmt::format("only its position packets arrive; its laser or motor is off (see its web page), or its data "
                       "packets go to another port (locusctl sensors): set lidars.{}.port",
                       options.name);
  const std::string unknown = now.unknown_packets ? fmt::format(" ({})", to_string(*now.unknown_packets)) : "";
  if (options.is_ouster())
    return stale_metadata(options, now)
        .value_or(
            fmt::format("what comes is refused, for the reasons that locusctl status counts: is {} the metadata of "
                        "this sensor, as it is set now? locusctl fetch SENSOR fetches it",
                        options.metadata));
  return fmt::format("what comes is refused, for the reasons that locusctl status counts{}: is it a lidar "
                     "whose packets can be read, and lidars.{}.model the right one?",
                     unknown, options.name);
}

/// Logs faults of sources that remain in partial use; those of a lost source are logged with its loss.
void Watch::look_at_verdicts(const IngestReport& ingest) {
  const auto& sources = config_.motion_sources;
  for (std::size_t i = 0; i < sources.size(); ++i) {
    const std::string_view verdict = ingest.sources[i].healthy ? ingest.sources[i].verdict : std::string_view{};
    if (!verdict.empty() && verdict != verdicts_[i])
      log_.warn(fmt::format("motion source {} {}", sources[i].name, verdict), {{"LOCUS_SOURCE", sources[i].name}});
    verdicts_[i] = verdict;
    if (const auto slow = slow_imu(sources[i], ingest.sources[i]); slow && !slow_told_.test(i)) {
      log_.warn(*slow, {{"LOCUS_SOURCE", sources[i].name}});
      slow_told_.set(i);
    }
  }
}

void Watch::look_at_calibration(const Figures& figures) {
  const auto& sources = config_.motion_sources;
  for (std::size_t i = 0; i < sources.size(); ++i) {
    if (askew_[i])
      continue;
    if (const std::string doubt = calibration_doubt(figures, i); !doubt.empty()) {
      log_.warn(fmt::format("motion source {} {}", sources[i].name, doubt), {{"LOCUS_SOURCE", sources[i].name}});
      askew_.set(i);
    }
  }
}

void Watch::look_at_speed(double largest_mps) {
  if (const auto warning = too_fast(config_.odometry.motion, largest_mps); warning && !told_speed_) {
    log_.warn(*warning);
    told_speed_ = true;
  }
}

void Watch::look_at_load(const SweepCounters& counters) {
  const Duration now = clock_(CLOCK_MONOTONIC);
  if (now - weighed_ < kPatience)
    return;
  weighed_ = now;
  const std::uint64_t drops = counters.dropped;
  if (drops > sweep_drops_)
    log_.warn(fmt::format(
        "this computer is too busy: {} sweeps were dropped within {} s; see /usr/share/doc/locusd/tuning.md, and what "
        "else runs here",
        drops - sweep_drops_, std::chrono::duration_cast<std::chrono::seconds>(kPatience).count()));
  sweep_drops_ = drops;
}

void Watch::look_at_drops(const Figures::Live& live) {
  const std::uint64_t drops = live.kernel_drops;
  if (drops != kernel_drops_)
    log_.warn(fmt::format("the kernel threw away {} lidar packets, for their buffer was full; sysctl "
                          "net.core.rmem_max={}, or a higher realtime.priority",
                          drops - kernel_drops_, UdpSocket::kWantedBufferBytes));
  kernel_drops_ = drops;
  const std::uint64_t filtered = live.filtered;
  if (filtered != filtered_)
    log_.warn(fmt::format(
        "the ports of the lidars are flooded: the kernel has kept out {} datagrams that are no lidar's "
        "by length or sender; tcpdump shows whose, /usr/share/doc/locusd/security.md what to set against them",
        filtered - filtered_));
  filtered_ = filtered;
}

void Watch::look_at_intruders(const LinkFigures& link) {
  const auto tell = [this](std::uint64_t refused, const std::string& topic, const std::string& source) {
    if (refused > 0 && intruded_.insert(topic).second)
      log_.warn(
          fmt::format("{}messages on {} are refused: a second publisher, or more than {} kHz; give each publisher its "
                      "own topic",
                      source.empty() ? "" : "motion source " + source + ": ", topic, Admission::kMaxRateKhz),
          {{"LOCUS_SOURCE", source}});
  };
  for (std::size_t i = 0; i < link.sources.size(); ++i) {
    const MotionSource& source = config_.motion_sources[i];
    tell(link.sources[i].refused, source.topic, source.name);
    tell(link.sources[i].health_refused, source.health_topic, source.name);
  }
  tell(link.flat_ground_refused, config_.dds.flat_ground_topic, "");
}

/// Logs changes of the recording. Drops during a disk failure are not logged separately.
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
