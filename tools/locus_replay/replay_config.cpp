// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/replay_config.hpp"

#include <algorithm>
#include <cstdlib>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "bags/bag.hpp"
#include "config/config_yaml.hpp"
#include "config/lidar_metadata.hpp"
#include "kitti/kitti_drive.hpp"
#include "locus_replay/bag_lidars.hpp"
#include "locus_replay/bag_mountings.hpp"
#include "locus_replay/bag_sources.hpp"
#include "locus_replay/bag_survey.hpp"
#include "locus_replay/capture_lidars.hpp"
#include "locus_replay/failure.hpp"
#include "locus_replay/recorded_input.hpp"
#include "sweep_folder/sweep_folder.hpp"

namespace locus::tools {
namespace {

Config config_or_fail(Expected<Config, ConfigErrors> config) {
  if (!config)
    throw Failure(ExitStatus::wrong_usage, fmt::format("{}", fmt::join(config.error(), "\n")));
  return *config;
}

Isa isa_or_fail(const std::string& name) {
  const std::optional<Isa> isa = from_string<Isa>(name);
  if (!isa || !is_supported(*isa))
    throw Failure(ExitStatus::wrong_usage,
                  fmt::format("LOCUS_ISA={}: {}; unset it, or choose one of {} that this processor has", name,
                              isa ? "this processor cannot run it" : "no such instruction set",
                              fmt::join(names_of(Isa{}), ", ")));
  return *isa;
}

/// Completes the configuration by the metadata of its lidars and the requested instruction set.
Config completed(Config config) {
  config = config_or_fail(with_lidar_metadata(std::move(config)));
  if (const char* const isa = std::getenv("LOCUS_ISA")) // NOLINT(concurrency-mt-unsafe): never set here
    config.use(isa_or_fail(isa));
  return config;
}

constexpr double kFastestCar_mps = 60.0;

/// Derives the configuration from the files of a folder that has none: which sources there are, those of a walking
/// robot first, and whether it was a car.
Config configuration_of(const CaptureFolder& folder, const std::filesystem::path& capture, ConfigReasons& reasons) {
  Config config;
  if (KittiDrive::is(capture) || SweepFolder::is_kitti_odometry(capture)) {
    config.odometry.motion.max_speed_mps = kFastestCar_mps;
    reasons.of_key["motion.max_speed_mps"] = "KITTI's recordings are those of a car";
    reasons.of_key["lidars.0.name"] = "points of a drive of KITTI";
  }
  for (const char* const name : {"kio", "vio"}) {
    if (std::ranges::find(folder.odometry, name, &CaptureFolder::Source::name) == folder.odometry.end())
      continue;
    config.motion_sources.insert(config.motion_sources.begin(), {{name, SourceKind::odometry, {}}, "", ""});
  }
  return config;
}

/// Makes the first lidar read the sweeps of a folder, whatever its packet settings.
void configure_sweeps(const std::filesystem::path& capture, Config& config, ConfigReasons& reasons) {
  LidarOptions& lidar = config.lidars.front();
  if (!lidar.gives_clouds()) {
    LidarOptions replacement;
    replacement.name = lidar.name;
    replacement.topic = "/sweeps";
    replacement.T_base_lidar = lidar.T_base_lidar;
    replacement.isa = lidar.isa;
    lidar = std::move(replacement);
    reasons.of_key["lidars.0.topic"] = "files of sweeps, which have no topic: any name";
  }
  if (SweepFolder::is_kitti_odometry(capture) && lidar.point_times == PointTimesFrom::automatic) {
    lidar.point_times = PointTimesFrom::none;
    reasons.of_key["lidars.0.point_times"] = "corrected for the motion during a sweep, as published";
  }
}

/// Returns whether the user gives a file for an IMU: it belongs to the first one.
bool has_sample_file(const Arguments& arguments, const Config& config, SourceId source) {
  const auto first = std::ranges::find_if(
      config.motion_sources, [](const MotionSource& s) { return s.kind == SourceKind::imu && !s.of_lidar; });
  return !arguments.imu.empty() &&
         static_cast<std::ptrdiff_t>(index_of(source)) == first - config.motion_sources.begin();
}

} // namespace

Config read_configuration(const std::filesystem::path& file, const std::vector<std::string>& overrides) {
  Config config;
  if (!file.empty())
    config = config_or_fail(load_config(file));
  return completed(config_or_fail(override_config(config, overrides)));
}

Config configuration_for(const FoundRecording& found, const std::filesystem::path& file, const Arguments& arguments,
                         std::vector<std::string>& lines, ConfigReasons& reasons, FoundMetadata& metadata) {
  Config config =
      file.empty() ? configuration_of(found.files, found.capture, reasons) : config_or_fail(load_config(file));
  reasons.of_other_keys = file.empty() ? "by --set" : "as in " + file.string();
  std::optional<BagSurvey> survey;
  if (looks_like_bag(found.capture))
    survey = BagSurvey::of(found.capture);
  if (survey && file.empty()) {
    const std::string lidar_frame = configure_lidars_of(*survey, found.capture, config, lines, reasons);
    configure_sources_of(*survey, lidar_frame, config, reasons);
  } else if (file.empty()) {
    configure_lidar_of_capture(found.files.lidar.front(), config, lines, reasons);
  }
  if (arguments.config.empty())
    use_recorded_metadata(found.files, config);
  if (gives_sweeps(found.capture))
    configure_sweeps(found.capture, config, reasons);
  const Config before = config;
  config = config_or_fail(override_config(config, arguments.overrides));
  if (file.empty() || survey)
    metadata = find_metadata(found.files, config);
  config = completed(std::move(config));
  if (survey)
    mount_by_transforms(
        *survey, found.capture.string(), UnsetMountings::in(before, file, arguments.overrides),
        [&](SourceId source) { return has_sample_file(arguments, config, source); }, config, lines, reasons);
  config.sweep.keeps_returns = !arguments.sweeps.empty();
  return config;
}

} // namespace locus::tools
