// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string>
#include <string_view>

#include "config/config_yaml.hpp"
#include "core/base/pose.hpp"
#include "daemon/figures.hpp"
#include "daemon/metrics_text.hpp"
#include "daemon/process_metrics.hpp"
#include "drivers/net/datagram.hpp"

namespace locus::daemon {
namespace {

using Labels = MetricsText::Labels;

/// Adds a state set with the current state among all states of `E`.
template <Named E> void add_states(MetricsText& text, Labels labels, std::string_view state) {
  for (const std::string_view name : names_of(E{}))
    text.add_state(labels, name, name == state);
}
template <Named E> void add_states(MetricsText& text, Labels labels, E state) {
  add_states<E>(text, labels, to_string(state));
}

template <Named E>
void add_reasons(MetricsText& text, std::string_view key, std::string_view name, const auto& counts) {
  for (std::size_t i = 0; i < counts.size(); ++i)
    text.add({{key, name}, {"reason", to_string(static_cast<E>(i))}}, counts[i]);
}

void add_build(MetricsText& text, const Figures& figures) {
  text.info("locusd_build", "The program.");
  text.add_info({{"version", LOCUS_VERSION}});
  text.info("locusd_config", "The configuration in effect, as --print-config prints it, and the instruction set.");
  text.add_info({{"sha256", config_sha256(figures.config)}, {"isa", to_string(figures.config.odometry.isa)}});
}

double sigma(const OdometryEstimate& estimate, Eigen::Index axis) {
  return std::sqrt(std::max(0.0, estimate.pose_covariance(axis, axis)));
}

void add_estimate(MetricsText& text, const SweepFigures& sweeps) {
  const std::optional<OdometryEstimate>& last = sweeps.last;
  text.gauge("locusd_estimate_rate_hertz", "Estimates per second, over the last five seconds.");
  text.add(sweeps.rate_hz);
  text.state_set("locusd_state", "State of the last estimate; waiting before the first.");
  text.add_state({}, "waiting", !last);
  for (const std::string_view state : names_of(TrackingState{}))
    text.add_state({}, state, last && state == to_string(last->state));
  if (!last)
    return;
  text.info("locusd_beginning", "Source of the first pose: origin, told, odometry or map.");
  if (last->beginning)
    text.add_info({{"from", to_string(*last->beginning)}});
  text.gauge("locusd_estimate_age_seconds", "Time since the end of the last estimated sweep.");
  text.add(to_seconds(time_since(last->stamp).value_or(Duration{})));
  text.gauge("locusd_position_sigma_meters", "Standard deviation of the position, over the path since the start.");
  for (std::size_t axis = 0; axis < 3; ++axis)
    text.add({{"axis", kAxes[axis]}}, sigma(*last, static_cast<Eigen::Index>(axis)));
  text.gauge("locusd_attitude_sigma_radians", "Standard deviation of the attitude, over the path since the start.");
  for (std::size_t axis = 3; axis < 6; ++axis)
    text.add({{"axis", kAxes[axis]}}, sigma(*last, static_cast<Eigen::Index>(axis)));
  text.gauge("locusd_observability_ratio", "Observability of each axis of the base by lidar, from 0 to 1.");
  for (std::size_t axis = 0; axis < 6; ++axis)
    text.add({{"axis", kAxes[axis]}}, last->observability[static_cast<Eigen::Index>(axis)]);
}

void add_sweeps(MetricsText& text, const Figures& figures) {
  const SweepCounters& counters = figures.counters;
  text.counter("locusd_sweeps_seen", "Sweeps built.");
  text.add(counters.seen);
  text.counter("locusd_sweeps_processed", "Sweeps registered.");
  text.add(counters.processed);
  text.counter("locusd_sweeps_dropped", "Sweeps replaced by a newer one before they were processed.");
  text.add(counters.dropped);
  text.counter("locusd_sweeps_failed", "Sweeps not registered; the pose is a prediction.");
  text.add(counters.failed);
  text.counter("locusd_sweep_builder_restarts", "Restarts of the sweep because the time of the lidars stepped.");
  text.add(figures.ingest.sweeps.restarts);
  text.histogram("locusd_sweep_process_seconds", "Time from the cut of a sweep to its estimate.");
  text.add_buckets(figures.sweeps.process);
  text.counter("locusd_sweep_stage_cpu_seconds", "Processor time of the sweeps by stage.");
  for (std::size_t i = 0; i < kStages; ++i)
    text.add({{"stage", to_string(static_cast<Stage>(i))}}, to_seconds(figures.sweeps.stages[i]));
  text.gauge("locusd_largest_speed_meters_per_second", "Largest speed of any estimate.");
  text.add(figures.sweeps.largest_speed_mps);
}

void add_datagrams(MetricsText& text, const PacketCounters& total) {
  text.counter("locusd_datagrams_received", "Datagrams on the ports of all lidars, from any sender.");
  text.add(total.received);
  text.counter("locusd_datagrams_rejected", "Datagrams on the ports of all lidars that are not used.");
  for (std::size_t i = 0; i < total.rejected.size(); ++i)
    text.add({{"reason", to_string(static_cast<PacketError>(i))}}, total.rejected[i]);
}

/// Adds the metrics of lidars that publish clouds; none if there is no such lidar.
void add_clouds(MetricsText& text, const Figures& figures) {
  const std::vector<LidarOptions>& lidars = figures.config.lidars;
  if (std::ranges::none_of(lidars, [](const LidarOptions& lidar) { return lidar.gives_clouds(); }))
    return;
  const auto for_each = [&](const auto& add) {
    for (std::size_t i = 0; i < lidars.size(); ++i) {
      if (figures.ingest.lidars[i].clouds)
        add(lidars[i].name, *figures.ingest.lidars[i].clouds);
    }
  };
  const auto count = [&](std::string_view name, std::string_view help, std::uint64_t CloudCounters::*counter) {
    text.counter(name, help);
    for_each([&](const auto& lidar, const auto& clouds) { text.add({{"lidar", lidar}}, clouds.counters.*counter); });
  };
  count("locusd_clouds_received", "Clouds of a lidar.", &CloudCounters::received);
  count("locusd_clouds_used", "Used clouds.", &CloudCounters::used);
  count("locusd_clouds_reordered", "Used clouds after a later one.", &CloudCounters::reordered);
  count("locusd_clouds_clock_steps", "Steps of the stamps of a lidar's clouds.", &CloudCounters::clock_steps);
  count("locusd_cloud_points", "Points of the used clouds, with or without a return.", &CloudCounters::points);
  text.counter("locusd_clouds_dropped", "Clouds replaced by a newer one before they were processed.");
  for (std::size_t i = 0; i < lidars.size(); ++i) {
    if (lidars[i].gives_clouds())
      text.add({{"lidar", lidars[i].name}}, figures.live->cloud_drops[i]);
  }
  text.counter("locusd_clouds_refused", "Clouds that are not used.");
  for_each([&](const auto& lidar, const auto& clouds) {
    add_reasons<CloudError>(text, "lidar", lidar, clouds.counters.refused);
  });
  text.counter("locusd_cloud_points_left_out", "Points of the used clouds without a return.");
  for_each([&](const auto& lidar, const auto& clouds) {
    text.add({{"lidar", lidar}, {"reason", "nan"}}, clouds.counters.nan);
    text.add({{"lidar", lidar}, {"reason", "origin"}}, clouds.counters.origin);
    text.add({{"lidar", lidar}, {"reason", "untimed"}}, clouds.counters.untimed);
  });
  text.gauge("locusd_cloud_rate_hertz", "Clouds per second by their stamps.");
  for_each([&](const auto& lidar, const auto& clouds) {
    text.add({{"lidar", lidar}}, 1.0 / to_seconds(clouds.period));
  });
}

void add_lidars(MetricsText& text, const Figures& figures) {
  const auto for_each = [&](const auto& add) {
    for (std::size_t i = 0; i < figures.config.lidars.size(); ++i)
      add(figures.config.lidars[i], figures.ingest.lidars[i]);
  };
  const auto count = [&](std::string_view name, std::string_view help, std::uint64_t PacketCounters::*counter) {
    text.counter(name, help);
    for_each([&](const auto& options, const auto& lidar) {
      if (!lidar.clouds)
        text.add({{"lidar", options.name}}, lidar.packets.*counter);
    });
  };
  count("locusd_packets_received", "Datagrams of a lidar.", &PacketCounters::received);
  count("locusd_packets_data", "Used data packets.", &PacketCounters::data);
  count("locusd_packets_position", "Position packets.", &PacketCounters::position);
  count("locusd_packets_lost", "Missing data packets, by gaps in stamp and azimuth.", &PacketCounters::lost);
  count("locusd_packets_reordered", "Used data packets after a later one.", &PacketCounters::reordered);
  count("locusd_lidar_clock_steps", "Steps of the lidar's clock.", &PacketCounters::clock_steps);
  text.counter("locusd_packets_rejected", "Datagrams that are not used.");
  for_each([&](const auto& options, const auto& lidar) {
    if (!lidar.clouds)
      add_reasons<PacketError>(text, "lidar", options.name, lidar.packets.rejected);
  });
  text.gauge("locusd_lidar_silence_seconds", "Time since the last used data packet, or since the start.");
  for_each([&](const auto& options, const auto& lidar) {
    text.add({{"lidar", options.name}}, to_seconds(time_since(lidar.last_received).value_or(figures.duration)));
  });
  text.gauge("locusd_lidar_rotation_hertz", "Revolutions per second; 0 before the first data packet.");
  for_each([&](const auto& options, const auto& lidar) {
    text.add({{"lidar", options.name}}, lidar.rotation_rate_rpm / 60.0);
  });
  text.info("locusd_lidar", "Model and return mode of a lidar; missing before its first packet.");
  for_each([&](const auto& options, const auto& lidar) {
    if (!lidar.model.empty())
      text.add_info({{"lidar", options.name}, {"model", lidar.model}, {"return_mode", lidar.return_mode}});
  });
  text.state_set("locusd_lidar_pps", "Pulse per second, from position packets.");
  for_each([&](const auto& options, const auto& lidar) {
    if (!lidar.has_date)
      add_states<velodyne::PpsState>(text, {{"lidar", options.name}}, lidar.pps);
  });
  bool any_has_date = false;
  for_each([&](const auto&, const auto& lidar) { any_has_date = any_has_date || lidar.has_date; });
  if (any_has_date) {
    text.state_set("locusd_lidar_clock", "Reference of the clock of an Ouster or a Hesai.");
    for_each([&](const auto& options, const auto& lidar) {
      if (lidar.has_date)
        add_states<TimeScale>(text, {{"lidar", options.name}}, lidar.pps);
    });
  }
  text.gauge("locusd_lidar_problem", "1 while locusctl status shows a problem of the lidar's packets.");
  for_each([&](const auto& options, const auto& lidar) {
    text.add({{"lidar", options.name}}, problem_of(options, lidar).empty() ? 0 : 1);
  });
}

void add_innovations(MetricsText& text, const Figures& figures) {
  if (!figures.sweeps.last)
    return;
  const auto add = [&](std::string_view name, std::string_view help, std::size_t first_axis, const auto& value_of) {
    text.gauge(name, help);
    for (std::size_t i = 0; i < figures.config.motion_sources.size(); ++i)
      for (std::size_t axis = first_axis; axis < first_axis + 3; ++axis)
        text.add({{"source", figures.config.motion_sources[i].name}, {"axis", kAxes[axis]}},
                 value_of(figures.sweeps.last->sources[i].innovation, static_cast<Eigen::Index>(axis)));
  };
  const auto value = [](const Innovation& innovation, Eigen::Index axis) { return innovation.value[axis]; };
  const auto deviation = [](const Innovation& innovation, Eigen::Index axis) {
    return std::sqrt(innovation.variance[axis]);
  };
  add("locusd_source_velocity_innovation_meters_per_second", "Velocity of a source minus that of everything else.", 0,
      value);
  add("locusd_source_velocity_innovation_sigma_meters_per_second", "Its expected deviation; 0 if not measured.", 0,
      deviation);
  add("locusd_source_turn_innovation_radians_per_second", "Turn rate of a source minus that of everything else.", 3,
      value);
  add("locusd_source_turn_innovation_sigma_radians_per_second", "Its expected deviation; 0 if not measured.", 3,
      deviation);
}

void add_sources(MetricsText& text, const Figures& figures) {
  const auto for_each = [&](const auto& add) {
    for (std::size_t i = 0; i < figures.config.motion_sources.size(); ++i)
      add(figures.config.motion_sources[i].name, i);
  };
  const auto count = [&](std::string_view name, std::string_view help, const auto& value_of) {
    text.counter(name, help);
    for_each([&](const std::string& source, std::size_t i) { text.add({{"source", source}}, value_of(i)); });
  };
  const auto& sources = figures.ingest.sources;
  const std::vector<LinkFigures::Source>& link = figures.live->link.sources;
  text.state_set("locusd_source_health", "Health of a motion source.");
  for_each([&](const std::string& source, std::size_t i) {
    for (const std::string_view health : {"healthy", "lost", "never heard"})
      text.add_state({{"source", source}}, health, health == health_of(sources[i]));
  });
  count("locusd_source_samples_received", "Samples of a motion source.",
        [&](std::size_t i) { return sources[i].counters.received; });
  text.counter("locusd_source_samples_rejected", "Unused samples, plus one for each silence or disagreement.");
  for_each([&](const std::string& source, std::size_t i) {
    add_reasons<HealthReason>(text, "source", source, sources[i].counters.rejected);
  });
  count("locusd_source_sweeps_used", "Sweeps whose prior used the source.",
        [&](std::size_t i) { return figures.sweeps.used_sweeps[i]; });
  count("locusd_source_health_changes", "Losses and returns of the source.",
        [&](std::size_t i) { return sources[i].counters.health_changes; });
  count("locusd_source_messages_refused", "Messages of a second publisher, or above 10 kHz.",
        [&](std::size_t i) { return link[i].refused; });
  count("locusd_source_health_messages_refused", "The same of the health topic.",
        [&](std::size_t i) { return link[i].health_refused; });
  text.gauge("locusd_source_writers", "Publishers of the topic of the source.");
  for_each([&](const std::string& source, std::size_t i) { text.add({{"source", source}}, link[i].writers); });
  text.gauge("locusd_source_silence_seconds", "Time since the last good sample; missing before the first.");
  for_each([&](const std::string& source, std::size_t i) {
    if (const auto silence = time_since(sources[i].last_received))
      text.add({{"source", source}}, to_seconds(*silence));
  });
  text.gauge("locusd_source_test_ratio", "Above 1 where everything else contradicts the source.");
  for_each([&](const std::string& source, std::size_t i) {
    if (figures.sweeps.last)
      text.add({{"source", source}}, figures.sweeps.last->sources[i].test_ratio);
  });
  add_innovations(text, figures);
}

void add_drops(MetricsText& text, const Figures& figures, const Figures::Live& live) {
  const auto count = [&](std::string_view name, std::string_view help, std::uint64_t value) {
    text.counter(name, help);
    text.add(value);
  };
  count("locusd_kernel_drops", "Datagrams dropped because the socket buffer was full.", live.kernel_drops);
  count("locusd_flood_datagrams_dropped", "Datagrams of other senders, filtered by the kernel.", live.filtered);
  count("locusd_late_packets", "Packets too late for their sweep.", figures.ingest.sweeps.late_packets);
  count("locusd_overflowed_points", "Points over the limit of a sweep.", figures.ingest.sweeps.overflowed_points);
  count("locusd_motion_samples_dropped", "Samples dropped because the ring to the ingest was full.", live.motion_drops);
  count("locusd_flat_ground_messages_refused", "Messages of a second publisher.", live.link.flat_ground_refused);
  count("locusd_estimates_unfetched", "Estimates lost because the publisher was too slow.", live.unfetched);
  count("locusd_estimates_unpublished", "Estimates that DDS did not accept.", live.unpublished);
}

void add_outlets(MetricsText& text, const Figures::Live& live) {
  text.gauge("locusd_dds_connected", "1 while DDS is up.");
  text.add(live.link.connected ? 1 : 0);
  text.counter("locusd_dds_attempts", "Attempts to join DDS.");
  text.add(live.link.attempts);
  text.counter("locusd_resets", "Starts of the odometry at the origin or at a given pose, in this process.");
  text.add(live.resets);
  text.state_set("locusd_flat_ground", "Whether the ground is assumed level.");
  add_states(text, {}, live.flat_ground);
  if (live.incidents) {
    text.counter("locusd_incidents_kept", "Incidents stored.");
    text.add(live.incidents->stored);
    text.counter("locusd_incidents_suppressed", "Incidents too soon after another.");
    text.add(live.incidents->suppressed);
    text.counter("locusd_incident_inputs_dropped", "Inputs missing from the memory for the next incident.");
    text.add(live.incidents->dropped);
    text.gauge("locusd_incidents_problem",
               "1 if the last incident could not be stored, or the input for the next is not recorded.");
    text.add(live.incidents->problem.empty() ? 0 : 1);
  }
  if (!live.recording)
    return;
  text.gauge("locusd_recording_problem", "1 while nothing can be recorded.");
  text.add(live.recording->problem.empty() ? 0 : 1);
  text.gauge("locusd_recording_bytes", "Size of all recordings in the folder.");
  text.add(live.recording->bytes);
  text.counter("locusd_recording_inputs", "Inputs recorded.");
  text.add(live.recording->recorded);
  text.counter("locusd_recording_inputs_dropped", "Inputs lost because the disk was too slow or failed.");
  text.add(live.recording->dropped);
  text.counter("locusd_recording_inputs_unfit", "Samples that a recording cannot hold.");
  text.add(live.recording->unfit);
}

} // namespace

std::string to_open_metrics(const Figures& figures) {
  const Figures::Live& live = *figures.live;
  MetricsText text;
  add_build(text, figures);
  add_estimate(text, figures.sweeps);
  add_sweeps(text, figures);
  add_datagrams(text, figures.ingest.total);
  add_lidars(text, figures);
  add_clouds(text, figures);
  add_sources(text, figures);
  add_drops(text, figures, live);
  add_outlets(text, live);
  add_process(text);
  return text.finish();
}

} // namespace locus::daemon
