// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/calibrate.hpp"

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <utility>
#include <variant>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "daemon/calibration.hpp"
#include "daemon/inline_pipeline.hpp"
#include "locus_replay/output_file.hpp"
#include "locus_replay/progress_bar.hpp"

namespace locus::tools {
namespace {

using std::chrono::milliseconds;

constexpr int kPasses = 4;
constexpr double kMostLate_ms = 250.0; ///< accepted by the configuration

/// Angular rates of the gyros and of the estimates, for comparison.
struct Rates {
  struct Gyro {
    Stamp stamp;
    Eigen::Vector3d radps;
  };
  struct Estimated { ///< mean over a sweep
    Stamp start, end;
    Eigen::Vector3d radps;
  };
  std::array<std::vector<Gyro>, kMaxSources> gyros; ///< by source, sorted by stamp
  std::vector<Estimated> estimated;
};

struct Pass {
  LearnedSources learned; ///< with the time each was last received
  std::array<std::optional<daemon::OdometryComparison>, kMaxSources> comparisons;
  std::array<std::optional<Eigen::Matrix3d>, kMaxSources> gyro_axes; ///< HealthMonitor::gyro_axes()
  Rates rates;
};

using ProgressObserver = std::function<void(double done)>;

/// Replays with each source advanced by its configured lateness, as if its driver stamped and sent samples in time.
Pass replay(const Arguments& arguments, Config config, ChosenRecording chosen, const ProgressObserver& show) {
  std::vector<Duration> earlier;
  for (MotionSource& source : config.motion_sources)
    earlier.push_back(from_seconds(1e-3 * std::exchange(source.late_ms, 0.0)));
  chosen.config = config;
  OpenRecording open = open_recording(arguments, chosen, earlier);
  Pass pass;
  daemon::InlinePipeline pipeline(
      config, std::move(open.lidars), [&](const Sweep& sweep, const daemon::ProcessedSweep& done) {
        for (std::size_t i = 0; i < pass.learned.size(); ++i)
          if (done.estimate.sources[i].learned)
            pass.learned[i] = done.estimate.sources[i].learned;
        for (std::size_t i = 0; i < pass.comparisons.size(); ++i)
          daemon::compare(done.estimate, i, pass.comparisons[i]);
        show(open.recording->progress());
        if (!done.estimate.failed)
          pass.rates.estimated.push_back({sweep.start, sweep.end, done.estimate.twist_base.tail<3>()});
      });
  for (bool goes_on = true; goes_on;) {
    const daemon::Input input = open.recording->next(Duration::zero());
    pipeline.process(input);
    goes_on = !std::holds_alternative<daemon::EndOfInput>(input);
    const auto* const imu = std::get_if<daemon::ImuInput>(&input);
    if (imu == nullptr || !imu->sample.angular_velocity_radps.allFinite())
      continue;
    auto& gyro = pass.rates.gyros[index_of(imu->source)];
    if (gyro.empty() || gyro.back().stamp < imu->sample.stamp)
      gyro.push_back({imu->sample.stamp, imu->sample.angular_velocity_radps});
  }
  for (std::size_t i = 0; i < config.motion_sources.size(); ++i)
    pass.gyro_axes[i] = pipeline.ingest().sources().health(SourceId{i}).gyro_axes();
  return pass;
}

/// Returns the share of variance left after the best rotation and bias align the gyro, read `late` after each sweep,
/// with the estimates (Wahba's problem); nothing if there is too little data.
std::optional<double> misfit(const std::vector<Rates::Gyro>& gyro, const std::vector<Rates::Estimated>& estimated,
                             Duration late) {
  constexpr std::size_t kFewest = 50;
  std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> both;
  auto next = gyro.begin();
  for (const Rates::Estimated& sweep : estimated) {
    const auto first = std::lower_bound(next, gyro.end(), sweep.start + late,
                                        [](const Rates::Gyro& sample, Stamp stamp) { return sample.stamp < stamp; });
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    auto end = first;
    for (; end != gyro.end() && end->stamp < sweep.end + late; ++end)
      sum += end->radps;
    next = first;
    if (end != first && end != gyro.end())
      both.emplace_back(sum / static_cast<double>(end - first), sweep.radps);
  }
  if (both.size() < kFewest)
    return std::nullopt;
  Eigen::Vector3d mean_gyro = Eigen::Vector3d::Zero(), mean_estimated = Eigen::Vector3d::Zero();
  for (const auto& [gyro_radps, estimated_radps] : both) {
    mean_gyro += gyro_radps / static_cast<double>(both.size());
    mean_estimated += estimated_radps / static_cast<double>(both.size());
  }
  Eigen::Matrix3d correlation = Eigen::Matrix3d::Zero();
  double variance = 0.0;
  for (const auto& [gyro_radps, estimated_radps] : both) {
    correlation += (gyro_radps - mean_gyro) * (estimated_radps - mean_estimated).transpose();
    variance += (gyro_radps - mean_gyro).squaredNorm() + (estimated_radps - mean_estimated).squaredNorm();
  }
  const Eigen::Matrix3d squared = correlation.transpose() * correlation; // eigenvalues: squared singular values
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> singular(squared, Eigen::EigenvaluesOnly);
  return 1.0 - 2.0 * singular.eigenvalues().cwiseMax(0.0).cwiseSqrt().sum() / variance;
}

/// Searches for a lateness too large for the filter to accept the gyro. The filter estimates the rest.
double coarse_lateness_ms(const std::vector<Rates::Gyro>& gyro, const std::vector<Rates::Estimated>& estimated) {
  constexpr Duration kMost = from_seconds(1e-3 * kMostLate_ms), kStep = milliseconds{10};
  constexpr double kPlainly = 0.5; ///< fraction of the misfit as configured
  const std::optional<double> as_configured = misfit(gyro, estimated, {});
  double best = std::numeric_limits<double>::infinity();
  Duration late{};
  for (Duration tried = -kMost; tried <= kMost; tried += kStep)
    if (const auto found = misfit(gyro, estimated, tried); found && *found < best) {
      best = *found;
      late = tried;
    }
  return as_configured && best < kPlainly * *as_configured ? 1e3 * to_seconds(late) : 0.0;
}

using Findings = std::array<std::optional<daemon::OdometryFindings>, kMaxSources>;

/// Returns the comparisons of a pass with the lateness beyond that which it removed.
Findings findings_of(const Pass& played) {
  Findings found;
  for (std::size_t i = 0; i < found.size(); ++i)
    if (played.comparisons[i])
      found[i] = played.comparisons[i]->findings();
  return found;
}

/// Rotates the lidars of `config`. What is observed relative to them rotates along: an IMU whose mounting is determined
/// by lidar, and one inside a lidar.
void turn_lidars(Config& config, const Eigen::Vector3d& turn_rad, const LearnedSources& learned) {
  const auto turn = [](Pose& T_base_sensor, const Eigen::Vector3d& by_rad) {
    T_base_sensor.rotation = (so3_exp(by_rad) * T_base_sensor.rotation).normalized();
  };
  for (LidarOptions& lidar : config.lidars)
    turn(lidar.T_base_lidar, turn_rad);
  for (std::size_t i = 0; i < config.motion_sources.size(); ++i) {
    MotionSource& source = config.motion_sources[i];
    if (source.of_lidar)
      turn(source.T_base_source, turn_rad);
    else if (source.kind == SourceKind::imu && source.calibration != Calibration::off && learned[i])
      turn(source.T_base_source, daemon::observed_part(turn_rad, source, *learned[i]));
  }
}

/// Converts calibration learned under one configuration to another with other extrinsics and lateness.
LearnedSource seen_from(const MotionSource& configured, const MotionSource& used, LearnedSource learned) {
  if (configured.kind == SourceKind::imu) {
    auto turn_rad = learned.states.segment<3>(LearnedSource::kMounting);
    turn_rad = so3_log(so3_exp(turn_rad) * used.T_base_source.rotation * configured.T_base_source.rotation.conjugate());
    learned.states[LearnedSource::kLate] += 1e-3 * used.late_ms;
  }
  return learned;
}

/// Rotates the lidars by what a pass has found.
void follow_lidars(const Pass& played, const Findings& compared, const Config& configured, CalibratedDrive& drive) {
  const std::optional<daemon::LidarTurn> found = daemon::turn_of_lidars(drive.config.motion_sources, compared);
  if (!found)
    return;
  drive.lidars = found;
  const Eigen::Vector3d total_rad = so3_log(so3_exp({found->rad[0].mean, found->rad[1].mean, found->rad[2].mean}) *
                                            drive.config.lidars.front().T_base_lidar.rotation *
                                            configured.lidars.front().T_base_lidar.rotation.conjugate());
  for (std::size_t axis = 0; axis < drive.lidars->rad.size(); ++axis)
    drive.lidars->rad[axis].mean = total_rad[static_cast<Eigen::Index>(axis)];
  turn_lidars(drive.config, daemon::known_turn_rad(*found), played.learned);
}

} // namespace

CalibratedDrive calibrate_by_drive(const Arguments& arguments, const ChosenRecording& chosen) {
  CalibratedDrive drive{chosen.config, chosen.config, {}, {}, {}};
  ProgressBar progress(!arguments.quiet);
  for (int pass = 0; pass < kPasses; ++pass) {
    const Pass played =
        replay(arguments, drive.config, chosen, [&](double done) { progress.show((pass + done) / kPasses); });
    const Findings compared = findings_of(played);
    for (std::size_t i = 0; i < drive.config.motion_sources.size(); ++i) {
      MotionSource& source = drive.config.motion_sources[i];
      if (source.calibration == Calibration::off || source.of_lidar) // its packets cannot be advanced
        continue;
      const std::optional<Pose> remounted = daemon::mounting_with(source, played.gyro_axes[i]);
      if (remounted)
        source.T_base_source = drive.start.motion_sources[i].T_base_source = *remounted;
      else if (played.learned[i])
        drive.learned[i] = seen_from(drive.start.motion_sources[i], source, *played.learned[i]);
      drive.compared[i] = compared[i];
      if (compared[i])
        drive.compared[i]->late_s.mean += 1e-3 * source.late_ms;
      const bool is_sure = source.calibration_sigma.late_ms == 0.0;
      const double coarse_ms =
          pass == 0 && !is_sure ? coarse_lateness_ms(played.rates.gyros[i], played.rates.estimated) : 0.0;
      if (coarse_ms == 0.0 && played.learned[i] && !remounted) {
        MotionSource in_time = source;
        in_time.late_ms = 0.0;
        MotionSourceOptions better = daemon::calibrated(in_time, *played.learned[i], compared[i]);
        better.late_ms = std::clamp(better.late_ms + source.late_ms, -kMostLate_ms, kMostLate_ms);
        static_cast<MotionSourceOptions&>(source) = std::move(better);
      } else {
        source.late_ms = std::clamp(source.late_ms + coarse_ms, -kMostLate_ms, kMostLate_ms);
      }
    }
    follow_lidars(played, compared, chosen.config, drive);
  }
  return drive;
}

void write_calibration(OutputFile& file, const Config& configured, const CalibratedDrive& drive) {
  nlohmann::ordered_json sources = nlohmann::ordered_json::object(), lidars = nlohmann::ordered_json::object();
  for (std::size_t i = 0; i < configured.motion_sources.size(); ++i) {
    const MotionSource& source = drive.start.motion_sources[i];
    if (!drive.learned[i] || source.calibration == Calibration::off)
      continue;
    nlohmann::ordered_json& learned = sources[source.name]["learned"];
    learned = daemon::learned_json(source, *drive.learned[i], true, drive.compared[i]);
    if (source.T_base_source != configured.motion_sources[i].T_base_source)
      learned["calibrated"].emplace("T_base_source", daemon::mounting_json(source.T_base_source));
  }
  if (drive.lidars)
    for (const LidarOptions& lidar : configured.lidars)
      lidars[lidar.name]["learned"] = daemon::learned_json(lidar, *drive.lidars);
  file.print("{}", daemon::calibration_yaml(sources, lidars));
  file.close();
}

} // namespace locus::tools
