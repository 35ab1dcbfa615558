// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/motion_recordings.hpp"

#include <algorithm>
#include <iterator>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "locus_replay/failure.hpp"

namespace locus::tools {
namespace {

struct MotionFile {
  std::string name; ///< of the source; empty for an IMU
  SourceKind kind;
  std::vector<std::filesystem::path> files; ///< at least one
  bool named_by_user;
};

std::vector<MotionFile> motion_files(const Arguments& arguments, const CaptureFolder& folder) {
  std::vector<MotionFile> files;
  if (!arguments.imu.empty())
    files.push_back({"", SourceKind::imu, {arguments.imu}, true});
  else if (!folder.imu.empty())
    files.push_back({"", SourceKind::imu, folder.imu, false});
  for (const Arguments::OdometryFile& named : arguments.odometry)
    files.push_back({named.name, SourceKind::odometry, {named.file}, true});
  for (const CaptureFolder::Source& found : folder.odometry) {
    if (std::ranges::none_of(arguments.odometry, [&](const auto& named) { return named.name == found.name; }))
      files.push_back({found.name, SourceKind::odometry, found.files, false});
  }
  return files;
}

/// Returns the source of a file: the first one of kind imu, or the odometry of this name.
std::optional<SourceId> source_of(const MotionFile& file, const std::vector<MotionSource>& sources) {
  const auto found = std::ranges::find_if(sources, [&](const MotionSource& source) {
    return source.kind == file.kind && !source.of_lidar && (file.kind == SourceKind::imu || source.name == file.name);
  });
  return found == sources.end() ? std::nullopt
                                : std::optional{SourceId{static_cast<std::size_t>(found - sources.begin())}};
}

std::string without_source(const MotionFile& file) {
  const std::string name = file.kind == SourceKind::imu ? "imu" : file.name;
  return fmt::format("{}: no motion source {} is configured; add {{name: {}, kind: {}}} to motion_sources",
                     file.files.front().string(), file.kind == SourceKind::imu ? "of kind imu" : "named " + name, name,
                     to_string(file.kind));
}

std::string without_file(const MotionSourceOptions& source) {
  return source.kind == SourceKind::imu
             ? fmt::format("motion source {}: never received, there is no imu.csv; name a file with --imu FILE",
                           source.name)
             : fmt::format("motion source {0}: never received, there is no {0}.tum; name a file with --odometry "
                           "{0}=FILE",
                           source.name);
}

template <class Sample>
MotionRecording read_as(const MotionFile& file, SourceId source, std::vector<std::string>& warnings) {
  using Samples = MotionSamples<Sample>;
  auto samples = value_or_fail(Samples::open(file.files, Samples::Order::recorded), ExitStatus::failed);
  std::ranges::copy(samples.breaks(), std::back_inserter(warnings));
  return {source, file.files.front(), std::move(samples)};
}

MotionRecording read(const MotionFile& file, SourceId source, std::vector<std::string>& warnings) {
  return file.kind == SourceKind::imu ? read_as<ImuSample>(file, source, warnings)
                                      : read_as<OdometrySample>(file, source, warnings);
}

} // namespace

std::vector<MotionRecording> read_motion(const Arguments& arguments, const CaptureFolder& folder, const Config& config,
                                         bool config_is_users_own, std::vector<std::string>& warnings) {
  const std::vector<MotionSource>& sources = config.motion_sources;
  std::vector<MotionRecording> recordings;
  const auto is_read = [&](SourceId source) {
    return std::ranges::any_of(recordings, [&](const MotionRecording& r) { return r.source == source; });
  };
  for (const MotionFile& file : motion_files(arguments, folder)) {
    const std::optional<SourceId> source = source_of(file, sources);
    if (source && is_read(*source))
      throw Failure(ExitStatus::wrong_usage, fmt::format("{}: a second file for motion source {}; remove one",
                                                         file.files.front().string(), file.name));
    if (source)
      recordings.push_back(read(file, *source, warnings));
    else if (file.named_by_user)
      throw Failure(ExitStatus::wrong_usage, without_source(file));
    else
      warnings.push_back(without_source(file) + "; not used");
  }
  for (std::size_t i = 0; config_is_users_own && i < sources.size(); ++i) {
    if (!is_read(SourceId{i}) && !sources[i].of_lidar)
      warnings.push_back(without_file(sources[i]));
  }
  return recordings;
}

} // namespace locus::tools
