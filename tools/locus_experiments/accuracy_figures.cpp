// SPDX-License-Identifier: Apache-2.0
#include "locus_experiments/accuracy_figures.hpp"

#include <algorithm>
#include <fstream>
#include <string_view>

#include "accuracy/trajectory_accuracy.hpp"
#include "config/config_yaml.hpp"
#include "drivers/files/capture_folder.hpp"
#include "drivers/files/capture_sequence.hpp"
#include "drivers/velodyne/position_packet.hpp"
#include "kitti/kitti_drive.hpp"
#include "locus_experiments/measurement.hpp"
#include "locus_experiments/odometry_rows.hpp"
#include "locus_replay/failure.hpp"
#include "locus_replay/quantiles.hpp"
#include "unpacking/unpacking_stream.hpp"

namespace locus::experiments {
namespace {

using nlohmann::ordered_json;
using std::filesystem::path;
using tools::ExitStatus;
using tools::Failure;
using tools::Quantiles;
using tools::value_or_fail;

/// Collects the speeds of all fixes, each once: the lidar repeats a receiver's sentence several times.
std::vector<double> speeds_of_fixes_mps(DatagramSource& capture) {
  std::vector<double> speeds;
  std::optional<Duration> last;
  while (const Datagram* datagram = capture.next()) {
    if (datagram->payload.size() != velodyne::kPositionPacketBytes)
      continue;
    const auto rmc = velodyne::parse_position_packet(datagram->payload.first<velodyne::kPositionPacketBytes>()).rmc;
    if (!rmc || !rmc->valid || !rmc->speed_mps || rmc->time_of_day == last)
      continue;
    last = rmc->time_of_day;
    speeds.push_back(*rmc->speed_mps);
  }
  return speeds;
}

std::vector<std::string> warnings_in(const path& log, const std::string& name, const path& recording) {
  constexpr std::string_view kWarning = "locus-replay: warning: ";
  std::ifstream stream{log};
  std::vector<std::string> warnings;
  for (std::string line; std::getline(stream, line);) {
    if (line.starts_with(kWarning))
      warnings.push_back(readable(line.substr(kWarning.size()), name, recording));
  }
  return warnings;
}

ordered_json to_json(const WayDrift& drift) {
  ordered_json json{{"way_m", drift.way_m}, {"percent", nullptr}, {"deg_per_100m", nullptr}};
  if (drift.percent) {
    json["percent"] = *drift.percent;
    json["deg_per_100m"] = *drift.deg_per_100m;
  }
  return json;
}

/// Counts the sweeps in each state.
ordered_json states_in(const std::vector<OdometryRow>& rows) {
  ordered_json states = ordered_json::object();
  for (const OdometryRow& row : rows)
    states[row.state] = states.value(row.state, 0) + 1;
  return states;
}

} // namespace

std::vector<std::string> imus_among(std::vector<std::string> names, const path& recording) {
  Config config;
  if (const auto folder = CaptureFolder::find(recording); folder && !folder->first_config().empty()) {
    if (auto loaded = load_config(folder->first_config()))
      config = *std::move(loaded);
  }
  const auto is_imu = [&](const std::string& name) {
    return std::ranges::any_of(config.motion_sources, [&](const MotionSourceOptions& source) {
      return source.name == name && source.kind == SourceKind::imu;
    });
  };
  std::erase_if(names, [&](const std::string& name) { return !is_imu(name); });
  return names;
}

std::vector<std::string> received_sources(const ordered_json& summary) {
  std::vector<std::string> names;
  for (const auto& [name, source] : summary.at("sources").items()) {
    if (source.at("received") > 0)
      names.push_back(name);
  }
  return names;
}

std::string readable(const std::string& message, const std::string& name, const path& recording) {
  constexpr std::string_view kProgram = "locus-replay: ";
  std::string line = message.starts_with(kProgram) ? message.substr(kProgram.size()) : message;
  const std::string where = recording.string();
  for (std::size_t at = 0; (at = line.find(where, at)) != std::string::npos; at += name.size())
    line.replace(at, where.size(), name);
  return line.starts_with(name + ": ") ? line.substr(name.size() + 2) : line;
}

ordered_json recording_figures(const std::string& name, const path& folder, const path& recording) {
  ordered_json figures{{"summary", read_json(folder / "summary.json")}};
  if (figures.at("summary").at("sweeps").at("seen") == 0)
    throw Failure(ExitStatus::failed, "no whole revolution of a lidar");
  const std::vector<std::string> received = received_sources(figures.at("summary"));
  figures["sources"] = received;
  figures["imus"] = imus_among(received, recording);
  figures["receiver"] = receiver_speed(recording);
  const OdometryRows odometry = read_odometry(folder);
  figures["states"] = states_in(odometry.rows);
  figures["claims"] = claims_of(odometry.estimates);
  if (const auto drift = way_drift(odometry.estimates, truth_of(recording)))
    figures["way"] = to_json(*drift);
  figures["warnings"] = warnings_in(folder / "log", name, recording);
  return figures;
}

ordered_json claims_of(const std::vector<StampedPose>& trajectory) {
  constexpr Duration kAtFirst = std::chrono::milliseconds{500};
  double farthest_at_first_m = 0, farthest_m = 0, most_turned_deg = 0;
  std::vector<double> speeds;
  for (std::size_t i = 1; i < trajectory.size(); ++i) {
    const Pose T_first_now = trajectory.front().T_source_base.inverse() * trajectory[i].T_source_base;
    const Pose T_last_now = trajectory[i - 1].T_source_base.inverse() * trajectory[i].T_source_base;
    farthest_m = std::max(farthest_m, T_first_now.translation.norm());
    if (trajectory[i].stamp - trajectory.front().stamp <= kAtFirst)
      farthest_at_first_m = farthest_m;
    most_turned_deg = std::max(most_turned_deg, angle_rad(T_first_now.rotation) / kRadPerDeg);
    if (const double elapsed_s = to_seconds(trajectory[i].stamp - trajectory[i - 1].stamp); elapsed_s > 0)
      speeds.push_back(T_last_now.translation.norm() / elapsed_s);
  }
  const Quantiles quantiles(speeds);
  return {{"poses", trajectory.size()},
          {"farthest_at_first_m", farthest_at_first_m},
          {"farthest_m", farthest_m},
          {"most_turned_deg", most_turned_deg},
          {"speed_mps", speeds.empty() ? ordered_json(nullptr)
                                       : ordered_json{{"median", quantiles.median()}, {"max", quantiles.at(1)}}}};
}

ordered_json receiver_speed(const std::filesystem::path& recording) {
  const auto folder = CaptureFolder::find(recording);
  if (!folder)
    return nullptr;
  auto capture = CaptureSequence::open(folder->lidar, tools::open_capture);
  if (!capture)
    return nullptr;
  const std::vector<double> speeds = speeds_of_fixes_mps(*capture);
  if (speeds.empty())
    return nullptr;
  const Quantiles quantiles(speeds);
  return {{"fixes", speeds.size()},
          {"min_mps", quantiles.at(0)},
          {"median_mps", quantiles.median()},
          {"max_mps", quantiles.at(1)}};
}

std::vector<StampedPose> truth_of(const std::filesystem::path& recording) {
  if (tools::KittiDrive::is(recording))
    return value_or_fail(tools::KittiDrive::open(recording), ExitStatus::failed).truth;
  const auto folder = CaptureFolder::find(recording);
  if (!folder || folder->ground_truth.empty())
    return {};
  return value_or_fail(read_trajectory(folder->ground_truth), ExitStatus::failed);
}

} // namespace locus::experiments
