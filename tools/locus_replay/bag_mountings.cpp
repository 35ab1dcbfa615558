// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/bag_mountings.hpp"

#include <cmath>
#include <cstddef>
#include <optional>

#include <fmt/format.h>

#include "config/config_yaml.hpp"
#include "locus_replay/bag_topics.hpp"

namespace locus::tools {
namespace {

using Parts = UnsetMountings::Parts;

/// Mounting that no robot has: found unchanged behind the assignments, it was not set.
const Pose& probe() {
  static const Pose pose{from_rpy_rad({0.1, 0.2, 0.3}), {1234.5, 2345.25, 3456.125}};
  return pose;
}

Parts parts_of_probe(const Pose& pose) {
  constexpr double kRounding_rad = 1e-6;
  return {angle_rad(pose.rotation.conjugate() * probe().rotation) < kRounding_rad,
          pose.translation == probe().translation};
}

/// Formats "0.100 0.000 0.750 m, 0.0 0.0 0.0 deg".
std::string text_of(const Pose& pose) {
  const auto rounded = [](double number, double unit) { return std::round(number / unit) * unit + 0.0; }; // not -0.0
  const Eigen::Vector3d& p = pose.translation;
  const Eigen::Vector3d rpy_deg = to_rpy_rad(pose.rotation) / kRadPerDeg;
  return fmt::format("{:.3f} {:.3f} {:.3f} m, {:.1f} {:.1f} {:.1f} deg", rounded(p.x(), 1e-3), rounded(p.y(), 1e-3),
                     rounded(p.z(), 1e-3), rounded(rpy_deg.x(), 0.1), rounded(rpy_deg.y(), 0.1),
                     rounded(rpy_deg.z(), 0.1));
}

/// Key of a mounting: by index for the reasons, by name for the user, whose file may list the sensors in another order.
struct Key {
  std::string by_index, by_name;
};

/// Mounts the sensors of one bag.
class Mounting {
 public:
  Mounting(const BagSurvey& survey, const std::string& bag_name, Config& config, std::vector<std::string>& lines,
           ConfigReasons& reasons)
      : survey_(survey), bag_name_(bag_name), config_(config), lines_(lines), reasons_(reasons),
        base_(config.dds.frame_base) {}

  void mount_lidars(const BagTopics& topics, const std::vector<Parts>& unset) {
    first_lidar_ = frame_of(topics.of_lidar.front());
    const bool is_base = !unset.empty() && unset.front().all() && topics.of_lidar.front() && !T_base(first_lidar_);
    if (is_base)
      use_first_lidar_as_base();
    for (std::size_t i = is_base ? 1 : 0; i < unset.size(); ++i) {
      const std::string frame = frame_of(topics.of_lidar[i]);
      mount("the lidar", frame, T_base(frame), unset[i], config_.lidars[i].T_base_lidar,
            {fmt::format("lidars.{}.T_base_lidar", i), fmt::format("lidars.{}.T_base_lidar", config_.lidars[i].name)});
    }
  }

  void mount_imus(const BagTopics& topics, const std::vector<Parts>& unset) {
    for (std::size_t i = 0; i < unset.size(); ++i) {
      MotionSource& source = config_.motion_sources[i];
      const std::string frame = frame_of(topics.of_source[i]);
      if (source.kind != SourceKind::imu || frame.empty())
        continue;
      std::optional<Pose> T_base_imu = T_base(frame);
      if (const auto T_lidar_imu = survey_.transforms.between(first_lidar_, frame); !T_base_imu && T_lidar_imu)
        T_base_imu = config_.lidars.front().T_base_lidar * *T_lidar_imu;
      mount(source.name, frame, T_base_imu, unset[i], source.T_base_source,
            {fmt::format("motion_sources.{}.T_base_source", i),
             fmt::format("motion_sources.{}.T_base_source", source.name)});
    }
  }

 private:
  [[nodiscard]] std::string frame_of(const std::optional<std::size_t>& topic) const {
    const auto found = topic ? survey_.topics.find(*topic) : survey_.topics.end();
    return found == survey_.topics.end() ? "" : found->second.frame;
  }

  [[nodiscard]] std::optional<Pose> T_base(const std::string& frame) const {
    return frame.empty() ? std::nullopt : survey_.transforms.between(base_, frame);
  }

  void use_first_lidar_as_base() {
    lines_.push_back(fmt::format("{}: /tf_static has no mounting of the lidar{} on {}, so poses are those of the "
                                 "lidar; set it with --set lidars.0.T_base_lidar.xyz_m=[X,Y,Z], and rpy_deg",
                                 bag_name_, first_lidar_.empty() ? "" : fmt::format(" ({})", first_lidar_), base_));
    reasons_.of_key["lidars.0.T_base_lidar"] = fmt::format(
        "{}: poses are those of the lidar",
        first_lidar_.empty() ? "messages of the lidar name no frame"
                             : fmt::format("/tf_static does not connect '{}' with {}", first_lidar_, base_));
    base_ = first_lidar_;
  }

  void mount(const std::string& sensor, const std::string& frame, const std::optional<Pose>& T_base_sensor,
             const Parts& unset, Pose& mounting, const Key& key) {
    if (!T_base_sensor && unset.rotation && !frame.empty())
      report_unknown(sensor, frame, key);
    if (!T_base_sensor || !unset.any())
      return;
    const Pose T_written = as_written(*T_base_sensor);
    if (unset.rotation)
      mounting.rotation = T_written.rotation;
    if (unset.translation)
      mounting.translation = T_written.translation;
    reasons_.of_key[key.by_index] = fmt::format("{} on {}, by /tf_static", frame, base_);
    lines_.push_back(fmt::format("{}: {} ({}) is mounted at {} on {}, by /tf_static{}", bag_name_, sensor, frame,
                                 text_of(mounting), base_, unset.all() ? "" : " and --set"));
  }

  void report_unknown(const std::string& sensor, const std::string& frame, const Key& key) {
    const std::string base = base_.empty() ? "the lidar" : base_;
    lines_.push_back(fmt::format("{}: /tf_static has no mounting of {} ({}) on {}, so its axes are assumed to be those "
                                 "of {}; set it with --set {}.rpy_deg=[ROLL,PITCH,YAW]",
                                 bag_name_, sensor, frame, base, base, key.by_name));
    reasons_.of_key[key.by_index] =
        fmt::format("/tf_static does not connect '{}' with {}: measure it, above all its rotation", frame, base);
  }

  const BagSurvey& survey_;
  const std::string& bag_name_;
  Config& config_;
  std::vector<std::string>& lines_;
  ConfigReasons& reasons_;
  std::string base_, first_lidar_; ///< frames
};

} // namespace

UnsetMountings UnsetMountings::in(const Config& config, const std::filesystem::path& file,
                                  std::span<const std::string> assignments) {
  const auto is_in_file = [&](const std::string& key) { return !file.empty() && sets_key(file, key); };
  Config changed = config;
  for (std::size_t i = 0; i < changed.lidars.size(); ++i) {
    if (!is_in_file(fmt::format("lidars.{}.T_base_lidar", i)))
      changed.lidars[i].T_base_lidar = probe();
  }
  for (std::size_t i = 0; i < changed.motion_sources.size(); ++i) {
    MotionSource& source = changed.motion_sources[i];
    if (source.kind == SourceKind::imu && !is_in_file(fmt::format("motion_sources.{}.T_base_source", i)))
      source.T_base_source = probe();
  }
  UnsetMountings unset;
  const auto overridden = override_config(changed, assignments);
  if (!overridden) // the kind of a source is set to one without a mounting
    return unset;
  for (const LidarOptions& lidar : overridden->lidars)
    unset.lidars.push_back(parts_of_probe(lidar.T_base_lidar));
  for (const MotionSource& source : overridden->motion_sources)
    unset.sources.push_back(parts_of_probe(source.T_base_source));
  return unset;
}

void mount_by_transforms(const BagSurvey& survey, const std::string& bag_name, const UnsetMountings& unset,
                         const std::function<bool(SourceId)>& has_file, Config& config, std::vector<std::string>& lines,
                         ConfigReasons& reasons) {
  const BagTopics topics = BagTopics::choose(*survey.bag, bag_name, config, has_file);
  Mounting mounting(survey, bag_name, config, lines, reasons);
  mounting.mount_lidars(topics, unset.lidars);
  mounting.mount_imus(topics, unset.sources);
}

} // namespace locus::tools
