// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>

#include "config/config.hpp"
#include "drivers/hesai/model.hpp"
#include "drivers/velodyne/model.hpp"

/// Single definition of all keys. fields() visits each key of a struct with its field; the reader fills the fields from
/// YAML, the writer creates YAML from them, so both know the same keys. If the file and the struct represent a value
/// differently, fields() converts before the visit and back after it.
namespace locus {

/// Words of the key `model`: Velodyne's models in their order, then Hesai's, then Ouster, whose metadata contains the
/// model. Other enumerations have their words next to them.
enum class ModelWord : std::uint8_t {};
inline constexpr std::size_t kFirstOfHesai = velodyne::kModels.size();
inline constexpr ModelWord kOusterWord{kFirstOfHesai + hesai::kModels};
inline auto names_of(ModelWord) {
  std::array<std::string_view, kFirstOfHesai + hesai::kModels + 1> names;
  std::ranges::transform(velodyne::kModels, names.begin(), [](velodyne::Model model) { return to_string(model); });
  std::ranges::copy(names_of(hesai::Model{}), names.begin() + kFirstOfHesai);
  names.back() = "Ouster";
  return names;
}

/// IPv4 address, dotted text in the file.
struct Ipv4 {
  std::uint32_t host_order = 0;
};

template <class Section> void fields(Section& section, Pose& T) {
  // Rounding to a nanodegree hides the error of the conversion to a rotation and back: 30 stays 30.
  Eigen::Vector3d rpy_deg = (to_rpy_rad(T.rotation) / kRadPerDeg).unaryExpr([](double angle_deg) {
    return std::round(angle_deg * 1e9) / 1e9 + 0.0; // no negative zero
  });
  section.key("xyz_m", T.translation);
  section.key("rpy_deg", rpy_deg);
  T.rotation = from_rpy_rad(rpy_deg * kRadPerDeg);
}

template <class Section> void fields(Section& section, LidarOptions& options) {
  const auto from_number = [](std::optional<std::uint32_t> ip) { return ip ? std::optional{Ipv4{*ip}} : std::nullopt; };
  std::optional<Ipv4> source_ip = from_number(options.source_ip);
  std::optional<Ipv4> multicast_ip = from_number(options.multicast_ip);
  std::optional<ModelWord> model;
  if (options.ouster)
    model = kOusterWord;
  else if (options.hesai)
    model = static_cast<ModelWord>(kFirstOfHesai + static_cast<std::size_t>(*options.hesai));
  else if (options.model)
    model = static_cast<ModelWord>(*options.model);
  section.key("name", options.name);
  section.key_or("model", model, "auto");
  section.key("port", options.port);
  section.key_or("source_ip", source_ip, "any");
  section.key_or("multicast_ip", multicast_ip, "none");
  section.key("time", options.time);
  section.key("calibration", options.calibration);
  section.key("topic", options.topic);
  section.key("point_times", options.point_times);
  section.key("metadata", options.metadata);
  section.key("T_base_lidar", options.T_base_lidar);
  const auto to_number = [](std::optional<Ipv4> ip) { return ip ? std::optional{ip->host_order} : std::nullopt; };
  options.ouster = model == kOusterWord;
  options.model.reset();
  options.hesai.reset();
  if (model && static_cast<std::size_t>(*model) < kFirstOfHesai)
    options.model = static_cast<velodyne::Model>(*model);
  else if (model && !options.ouster)
    options.hesai = static_cast<hesai::Model>(static_cast<std::size_t>(*model) - kFirstOfHesai);
  if (options.is_ouster() && !section.has("port"))
    options.port = 0;
  options.source_ip = to_number(source_ip);
  options.multicast_ip = to_number(multicast_ip);
}

template <class Section> void fields(Section& section, CalibrationSigma& sigma) {
  section.key_or("late_ms", sigma.late_ms, "auto");
  section.key_or("mounting_deg", sigma.mounting_deg, "auto");
  section.key_or("scale", sigma.scale, "auto");
  section.key_or("yaw_scale", sigma.yaw_scale, "auto");
}

template <class Section> void fields(Section& section, MotionSource& source) {
  section.key("name", source.name);
  section.key("kind", source.kind);
  section.key("topic", source.topic);
  section.key("health_topic", source.health_topic);
  section.key("use_acceleration", source.use_acceleration);
  section.key("T_base_source", source.T_base_source);
  section.key("late_ms", source.late_ms);
  section.key("scale", source.scale);
  section.key("yaw_scale", source.yaw_scale);
  section.key("calibration", source.calibration);
  section.key("calibration_sigma", source.calibration_sigma);
}

template <class Section> void fields(Section& section, BodyBoxOptions& options) {
  section.key("enabled", options.enabled);
  section.key("min_m", options.min_m);
  section.key("max_m", options.max_m);
}

template <class Section> void fields(Section& section, SegmentFilterOptions& options) {
  section.key("enabled", options.enabled);
  section.key_or("points", options.points, "auto");
}

template <class Section> void fields(Section& section, VoxelFilterOptions& options) {
  section.key("enabled", options.enabled);
  section.key("leaf_m", options.leaf_m);
}

template <class Section> void fields(Section& section, RandomFilterOptions& options) {
  section.key("enabled", options.enabled);
  section.key("keep", options.keep);
}

template <class Section> void fields(Section& section, SweepOptions& options) {
  constexpr double kLongestMs = 1e9; // clamps to the range of Duration; far outside the valid range
  std::optional<double> period_ms;
  if (options.sweep_period)
    period_ms = to_seconds(*options.sweep_period) * 1e3;
  std::array<double, 2> range_m{options.min_range_m, options.max_range_m};
  section.key_or("sweep_period_ms", period_ms, "auto");
  section.key("motion_correction", options.motion_correction);
  section.key("range_m", range_m);
  section.key("body_box", options.body_box);
  section.key("segment_filter", options.segment_filter);
  section.key("voxel_filter", options.voxel_filter);
  section.key("random_filter", options.random_filter);
  section.key("seed", options.seed);
  options.sweep_period.reset();
  if (period_ms)
    options.sweep_period = from_seconds(std::clamp(*period_ms, -kLongestMs, kLongestMs) * 1e-3);
  options.min_range_m = range_m[0];
  options.max_range_m = range_m[1];
}

template <class Section> void fields(Section& section, RegistrationOptions& options) {
  section.key("max_iterations", options.max_iterations);
  section.key("max_correspondence_m", options.max_correspondence_m);
}

template <class Section> void fields(Section& section, MapOptions& options) {
  section.key("keyframe_m", options.keyframe_m);
  section.key("keyframe_deg", options.keyframe_deg);
  section.key("max_bytes", options.max_bytes);
}

/// Options of scan-to-scan: a registration with a mode.
struct ScanToScan {
  ScanToScanMode mode;
  RegistrationOptions registration;
};

template <class Section> void fields(Section& section, ScanToScan& options) {
  section.key("mode", options.mode);
  fields(section, options.registration);
}

template <class Section> void fields(Section& section, MotionLimits& limits) {
  section.key("max_speed_mps", limits.max_speed_mps);
  section.key("max_acceleration_mps2", limits.max_acceleration_mps2);
}

template <class Section> void fields(Section& section, OdometryOptions& options) {
  ScanToScan scan_to_scan{options.scan_to_scan_mode, options.scan_to_scan};
  section.key("fusion", options.fusion);
  section.key("no_source_prior", options.no_source_prior);
  section.key("motion", options.motion);
  section.key("scan_to_scan", scan_to_scan);
  section.key("scan_to_submap", options.scan_to_submap);
  section.key("map", options.map);
  section.key("flat_ground", options.flat_ground);
  section.key("threads", options.threads);
  options.scan_to_scan_mode = scan_to_scan.mode;
  options.scan_to_scan = scan_to_scan.registration;
}

template <class Section> void fields(Section& section, RealtimeOptions& options) {
  section.key("priority", options.priority);
  section.key("cpus", options.cpus);
  section.key("lock_memory", options.lock_memory);
}

template <class Section> void fields(Section& section, DdsOptions& options) {
  section.key("domain", options.domain);
  section.key("interface", options.interface);
  section.key("prefix", options.prefix);
  section.key("frame_odom", options.frame_odom);
  section.key("frame_base", options.frame_base);
  section.key("publish_tf", options.publish_tf);
  section.key("publish_cloud", options.publish_cloud);
  section.key("publish_map", options.publish_map);
  section.key("flat_ground_topic", options.flat_ground_topic);
  section.key("security", options.security);
  section.key("type_hashes", options.type_hashes);
  section.key("ros_graph", options.ros_graph);
}

template <class Section> void fields(Section& section, RecordOptions& options) {
  section.key("folder", options.folder);
  section.key("max_bytes", options.max_bytes);
  section.key("keep_s", options.keep_s);
  section.key("keep_bytes", options.keep_bytes);
  section.key("incidents_bytes", options.incidents_bytes);
}

template <class Section> void fields(Section& section, MetricsOptions& options) {
  section.key("listen", options.listen);
}

template <class Section> void fields(Section& section, Config& config) {
  section.key("version", config.version);
  section.key("defaults", config.defaults);
  section.key("lidars", config.lidars);
  section.key("motion_sources", config.motion_sources);
  fields(section, config.sweep);
  fields(section, config.odometry);
  section.key("realtime", config.realtime);
  section.key("dds", config.dds);
  section.key("record", config.record);
  section.key("metrics", config.metrics);
}

struct AnySection;
/// Type with keys, which fields() visits, as opposed to a single value.
template <class T>
concept HasFields = requires(T& value, AnySection& section) {
  fields(section, value);
};

} // namespace locus
