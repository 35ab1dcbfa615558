// SPDX-License-Identifier: Apache-2.0
#include "locus_experiments/subset_figures.hpp"

#include <algorithm>
#include <iterator>
#include <span>
#include <vector>

#include <fmt/format.h>

#include "accuracy/pose_pairs.hpp"
#include "accuracy/trajectory_accuracy.hpp"
#include "drivers/files/capture_folder.hpp"
#include "locus_experiments/accuracy_figures.hpp"
#include "locus_experiments/harsh_figures.hpp"
#include "locus_experiments/odometry_rows.hpp"
#include "locus_replay/failure.hpp"

namespace locus::experiments {
namespace {

using nlohmann::ordered_json;
using std::filesystem::path;

double share_tracking(const std::vector<OdometryRow>& rows) {
  const auto tracking = std::ranges::count(rows, "tracking", &OdometryRow::state);
  return static_cast<double>(tracking) / std::max(1.0, static_cast<double>(rows.size()));
}

/// Returns the poses of all pieces of the recording within this time.
std::vector<StampedPose> poses_between(const CaptureFolder::Source& source, Stamp first, Stamp last) {
  std::vector<StampedPose> poses;
  for (const path& file : source.files)
    std::ranges::copy_if(read_poses(file), std::back_inserter(poses),
                         [&](const StampedPose& pose) { return pose.stamp >= first && pose.stamp <= last; });
  return poses;
}

/// Computes the error of an odometry source by itself; null if it is silent.
ordered_json alone(std::span<const StampedPose> poses, std::span<const StampedPose> truth) {
  const auto accuracy = trajectory_accuracy(poses, truth);
  if (!accuracy)
    return nullptr;
  return {{"mean_m", accuracy->ape_m.mean},
          {"worst_m", accuracy->ape_m.max},
          {"lost_after_s", lost_after_s(paired(poses, truth), 0)}};
}

} // namespace

ordered_json subset_figures(const path& run_folder, const path& recording, double mounting_rad) {
  const auto [estimates, rows] = read_odometry(run_folder);
  const std::vector<StampedPose> truth = truth_of(recording);
  const std::vector<PosePair> pairs = paired(estimates, truth);
  if (pairs.empty())
    throw tools::Failure(tools::ExitStatus::failed,
                         fmt::format("{}: has no estimate within the time of the truth", run_folder.string()));
  ordered_json figures{{"tracking", share_tracking(rows)}};
  figures.update(loss_figures(pairs, rows, mounting_rad));
  figures["odometry"] = ordered_json::object();
  if (const auto folder = CaptureFolder::find(recording)) {
    for (const CaptureFolder::Source& source : folder->odometry)
      figures["odometry"][source.name] = alone(poses_between(source, pairs.front().stamp, pairs.back().stamp), truth);
  }
  return figures;
}

} // namespace locus::experiments
