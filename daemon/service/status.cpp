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
  return fmt::format("{}, {:.1f} Hz, {:.1f} ms per sweep, {} dropped", to_string(sweeps.last->state), sweeps.rate_hz,
                     sweeps.process_ms.p50, figures.counters.dropped);
}

void SessionMonitor::check(const Figures& figures) {
  const Figures::Live& live = *figures.live;
  check_link(live.link);
  check_publishers(live.link);
  if (figures.duration > kPatience && live.link.connected)
    check_sources(live.link);
  check_lidars(figures);
  check_verdicts(figures.ingest);
  check_calibration(figures);
  check_speed(figures.sweeps.largest_speed_mps);
  check_load(figures.counters);
  check_drops(live);
  if (live.recording)
    check_recording(*live.recording);
  if (const Duration now = clock_(CLOCK_MONOTONIC); now - joined_at_ > kPatience) {
    join_multicast(config_, sockets_);
    joined_at_ = now;
  }
}

void SessionMonitor::check_link(const LinkFigures& link) {
  if (link.connected && !was_connected_)
    log_.info(fmt::format("DDS is up: domain {} on interface {}", config_.dds.domain, config_.dds.interface));
  else if (!link.connected && link.attempts != logged_attempts_)
    log_.warn(fmt::format("{}; retrying", link.problem), {{"LOCUS_ATTEMPT", std::to_string(link.attempts)}});
  was_connected_ = link.connected;
  logged_attempts_ = link.attempts;
}

void SessionMonitor::check_sources(const LinkFigures& link) {
  for (std::size_t i = 0; i < link.sources.size(); ++i) {
    const std::string& name = config_.motion_sources[i].name;
    const std::string& topic = config_.motion_sources[i].topic;
    if (topic.empty() || link.sources[i].received > 0 || !silent_sources_.insert(name).second)
      continue;
    const std::string found =
        link.sources[i].writers == 0
            ? fmt::format("no publisher found for {}; DDS uses interface {}, domain {} (dds.interface, dds.domain)",
                          topic, config_.dds.interface, config_.dds.domain)
            : fmt::format("topic {} has {} publishers on interface {}, but none has sent anything", topic,
                          config_.dds.interface, link.sources[i].writers);
    log_.warn(fmt::format("motion source {}: nothing received since the start, {} s ago: {}", name,
                          kPatience.count() / 1'000'000'000, found),
              {{"LOCUS_SOURCE", name}});
  }
}

void SessionMonitor::check_lidars(const Figures& figures) {
  const IngestReport& ingest = figures.ingest;
  const std::vector<LidarOptions>& lidars = figures.config.lidars;
  const Duration now = clock_(CLOCK_MONOTONIC);
  for (std::size_t i = 0; i < lidars.size(); ++i) {
    const std::uint64_t used = ingest.lidars[i].used();
    Lidar& lidar = lidars_[i];
    const bool has_new_data = used > lidar.data;
    if (used != lidar.data || lidar.last_data == Duration::zero()) { // fewer: the counters were reset
      if (has_new_data && lidar.logged_silence.any())
        log_.info(fmt::format("lidar {}: data received", lidars[i].name), {{"LOCUS_LIDAR", lidars[i].name}});
      lidar = {.data = used,
               .received = ingest.lidars[i].received(),
               .last_data = now,
               .logged_silence = {},
               .short_sweep_logged = lidar.short_sweep_logged,
               .shared_port_logged = lidar.shared_port_logged,
               .logged_doubts = lidar.logged_doubts,
               .logged_unused_pps = std::move(lidar.logged_unused_pps)};
    }
    const auto warning = short_sweep(figures.config.sweep, lidars[i].name, ingest.lidars[i].rotation_rate_rpm);
    if (warning && !std::exchange(lidar.short_sweep_logged, true))
      log_.warn(*warning, {{"LOCUS_LIDAR", lidars[i].name}});
    const auto shared = figures.duration > kPatience ? shared_port(lidars[i], ingest.lidars[i]) : std::nullopt;
    if (shared && !std::exchange(lidar.shared_port_logged, true))
      log_.warn(*shared, {{"LOCUS_LIDAR", lidars[i].name}});
    const auto unused = unused_pps(lidars[i], ingest.lidars[i]);
    if (unused && *unused != std::exchange(lidar.logged_unused_pps, *unused))
      log_.warn(*unused, {{"LOCUS_LIDAR", lidars[i].name}});
    check_doubts(lidar, lidars[i], ingest.lidars[i]);
    if (now - lidar.last_data < kPatience)
      continue;
    const auto [kind, why] = why_silent(lidar, lidars[i], ingest.lidars[i]);
    if (lidar.logged_silence.test(static_cast<std::size_t>(kind)))
      continue;
    lidar.logged_silence.set(static_cast<std::size_t>(kind));
    const std::string what = lidars[i].gives_clouds() ? fmt::format("cloud on topic {}", lidars[i].topic)
                                                      : fmt::format("data packet on UDP port {}", lidars[i].port);
    log_.warn(fmt::format("lidar {}: no {} for {} s; {}", lidars[i].name, what,
                          std::chrono::duration_cast<std::chrono::seconds>(now - lidar.last_data).count(), why),
              {{"LOCUS_LIDAR", lidars[i].name}});
  }
}

/// Logs each fault of a lidar's clouds once.
void SessionMonitor::check_doubts(Lidar& lidar, const LidarOptions& options, const IngestReport::Lidar& now) {
  const CloudDoubts doubts = now.clouds ? now.clouds->doubts : CloudDoubts{};
  if ((doubts & ~lidar.logged_doubts).none())
    return;
  IngestReport::Lidar unlogged = now;
  unlogged.clouds->doubts &= ~lidar.logged_doubts;
  lidar.logged_doubts |= doubts;
  for (const std::string& line : cloud_doubts(options, unlogged))
    log_.warn(line, {{"LOCUS_LIDAR", options.name}});
}

std::pair<SessionMonitor::Silence, std::string>
SessionMonitor::why_silent(const Lidar& lidar, const LidarOptions& options, const IngestReport::Lidar& now) {
  const PacketCounters& packets = now.packets;
  if (now.clouds)
    return now.received() == lidar.received
               ? std::pair{Silence::nothing_arrives, "check that its driver runs and publishes it in this domain, and "
                                                     "that DDS may use that interface"}
               : std::pair{Silence::rejected, "its clouds are rejected; locusctl status counts the reasons"};
  if (packets.received == lidar.received)
    return {Silence::nothing_arrives, "check its power and cable, and the address it sends to (locusctl sensors)"};
  if (packets[PacketError::sender] > 0 && now.refused_ip && now.source_ip)
    return {Silence::other_sender,
            fmt::format("packets come from {}, {} {}: set lidars.{}.source_ip to that of the lidar",
                        dotted(*now.refused_ip), options.source_ip ? "configured is" : "the lidar was",
                        dotted(*now.source_ip), options.name)};
  if (packets.data + packets.position == packets.received)
    return {Silence::positions_only,
            fmt::format("only its position packets arrive; its laser or motor is off (see its web page), or its data "
                        "packets go to another port (locusctl sensors): set lidars.{}.port",
                        options.name)};
  const std::string unknown = now.unknown_packets ? fmt::format(" ({})", to_string(*now.unknown_packets)) : "";
  if (options.is_ouster())
    return {
        Silence::rejected,
        stale_metadata(options, now)
            .value_or(fmt::format("its packets are rejected; locusctl status counts the reasons. Check that {} is "
                                  "the metadata of this sensor in its present mode; locusctl fetch SENSOR fetches it",
                                  options.metadata))};
  return {Silence::rejected,
          fmt::format("its packets are rejected{}; locusctl status counts the reasons. Check that the lidar is of a "
                      "supported model, and lidars.{}.model",
                      unknown, options.name)};
}

/// Logs faults of sources that remain in partial use; those of a lost source are logged with its loss.
void SessionMonitor::check_verdicts(const IngestReport& ingest) {
  const auto& sources = config_.motion_sources;
  for (std::size_t i = 0; i < sources.size(); ++i) {
    const std::string_view verdict = ingest.sources[i].healthy ? ingest.sources[i].verdict : std::string_view{};
    if (!verdict.empty() && verdict != logged_verdicts_[i])
      log_.warn(fmt::format("motion source {} {}", sources[i].name, verdict), {{"LOCUS_SOURCE", sources[i].name}});
    logged_verdicts_[i] = verdict;
    if (const auto slow = slow_imu(ingest.sources[i]); slow && !slow_imus_logged_.test(i)) {
      log_.warn(fmt::format("motion source {} {}", sources[i].name, *slow), {{"LOCUS_SOURCE", sources[i].name}});
      slow_imus_logged_.set(i);
    }
  }
}

void SessionMonitor::check_calibration(const Figures& figures) {
  const auto& sources = config_.motion_sources;
  for (std::size_t i = 0; i < sources.size(); ++i) {
    if (miscalibrated_[i])
      continue;
    if (const std::string doubt = calibration_warning(figures, i); !doubt.empty()) {
      log_.warn(fmt::format("motion source {} {}", sources[i].name, doubt), {{"LOCUS_SOURCE", sources[i].name}});
      miscalibrated_.set(i);
    }
  }
  if (mounting_logged_)
    return;
  if (const std::string warning = lidar_mounting_warning(figures); !warning.empty()) {
    log_.warn(warning);
    mounting_logged_ = true;
  }
}

void SessionMonitor::check_speed(double largest_mps) {
  if (const auto warning = too_fast(config_.odometry.motion, largest_mps); warning && !speed_logged_) {
    log_.warn(*warning);
    speed_logged_ = true;
  }
}

void SessionMonitor::check_load(const SweepCounters& counters) {
  const Duration now = clock_(CLOCK_MONOTONIC);
  if (now - load_checked_at_ < kPatience)
    return;
  load_checked_at_ = now;
  const std::uint64_t drops = counters.dropped;
  if (drops > sweep_drops_)
    log_.warn(fmt::format("this computer is overloaded: {} sweeps were dropped within {} s; see "
                          "/usr/share/doc/locusd/tuning.md, and check what else runs on it",
                          drops - sweep_drops_, std::chrono::duration_cast<std::chrono::seconds>(kPatience).count()));
  sweep_drops_ = drops;
}

void SessionMonitor::check_drops(const Figures::Live& live) {
  const std::uint64_t drops = live.kernel_drops;
  if (drops != kernel_drops_)
    log_.warn(fmt::format("the kernel dropped {} lidar packets because their receive buffer was full; set sysctl "
                          "net.core.rmem_max={}, or raise realtime.priority",
                          drops - kernel_drops_, UdpSocket::kWantedBufferBytes));
  kernel_drops_ = drops;
  const std::uint64_t filtered = live.filtered;
  if (filtered != filtered_)
    log_.warn(
        fmt::format("the ports of the lidars are flooded: the kernel has filtered {} datagrams that by length or "
                    "sender are no lidar's; find the sender with tcpdump, and see /usr/share/doc/locusd/security.md",
                    filtered - filtered_));
  filtered_ = filtered;
}

void SessionMonitor::check_publishers(const LinkFigures& link) {
  const auto report = [this](std::uint64_t refused, const std::string& topic, const std::string& source) {
    if (refused > 0 && contested_topics_.insert(topic).second)
      log_.warn(
          fmt::format("{}messages on {} are refused: a second publisher, or more than {} kHz; give each publisher its "
                      "own topic",
                      source.empty() ? "" : "motion source " + source + ": ", topic, Admission::kMaxRateKhz),
          {{"LOCUS_SOURCE", source}});
  };
  for (std::size_t i = 0; i < link.sources.size(); ++i) {
    const MotionSource& source = config_.motion_sources[i];
    report(link.sources[i].refused, source.topic, source.name);
    report(link.sources[i].health_refused, source.health_topic, source.name);
  }
  report(link.flat_ground_refused, config_.dds.flat_ground_topic, "");
}

/// Logs changes of the recording. Drops during a disk failure are not logged separately.
void SessionMonitor::check_recording(const Recorder::Status& recording) {
  const std::uint64_t dropped = recording.dropped - std::min(recording.dropped, recording_.dropped);
  if (recording_.problem.empty() && !recording.problem.empty())
    log_.error(fmt::format("{}; the odometry continues without a recording", recording.problem));
  else if (!recording.run.empty() &&
           (recording.run != recording_.run || (!recording_.problem.empty() && recording.problem.empty())))
    log_.info(fmt::format("recording to {}", recording.run.string()));
  else if (recording.problem.empty() && dropped > 0)
    log_.warn(
        fmt::format("{} inputs were not recorded because the disk is too slow; see record in locusd.yaml(5)", dropped));
  recording_ = recording;
}

Watchdog::Watchdog() {
  std::uint64_t period_us = 0;
  if (sd_watchdog_enabled(0, &period_us) > 0)
    period_ = std::chrono::microseconds{period_us / 3};
}

void Watchdog::feed(const Session& session) {
  const Duration now = read_clock(CLOCK_MONOTONIC);
  if (period_ == Duration::zero() || now - fed_at_ < period_)
    return;
  const Session::Progress progress = session.progress();
  const bool all_progress =
      !last_ || (progress.live.ingest != last_->live.ingest && progress.live.odometry != last_->live.odometry &&
                 progress.publisher != last_->publisher && progress.dds != last_->dds);
  if (!all_progress)
    return;
  sd_notify(0, "WATCHDOG=1");
  fed_at_ = now;
  last_ = progress;
}

} // namespace locus::daemon
