// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <vector>

#include "core/base/options.hpp"
#include "core/base/pose.hpp"
#include "core/ingest/sweep.hpp"
#include "core/odometry/gyro_bias.hpp"
#include "core/odometry/gyro_scale.hpp"
#include "core/odometry/odometry_estimate.hpp"
#include "core/odometry/prior_statistics.hpp"
#include "core/odometry/seen_axes.hpp"
#include "core/sources/registration_feedback.hpp"

namespace locus {

/// E of the paper's II-B.1: the motion since the last processed sweep, before a look at the points.
struct MotionPrior {
  Pose T_last_now;
  Vector6 variance = Vector6::Zero(); ///< in the axes of the base at the last sweep
  Vector6 bias = Vector6::Zero();     ///< the part of the deviation that comes again with the next sweep
  PriorSource source;
  bool blind = false; ///< nothing at all is known yet, not even a velocity
  Pose T_last_kept;   ///< T_last_now of a robot that goes on as before
};

/// What lidar found of the motion since the last processed sweep.
struct SeenMotion {
  Pose T_last_now;
  Matrix6 information = Matrix6::Zero(); ///< in the axes of the base at the last sweep
  bool stands = false;
};

/// What the motion sources say from one processed sweep to the next (paper II-B.1, sensor integration), and how far
/// each is to be believed: that is learned from what lidar finds. One owner.
class SensorIntegration {
 public:
  SensorIntegration(const OdometryOptions& options, std::vector<MotionSourceOptions> sources);

  /// The prior from the best healthy sources but `without`. What none of them says goes on with `twist_base` (m/s,
  /// rad/s), the velocity in the last sweep; nothing: not even that is known.
  [[nodiscard]] MotionPrior integrate(const Sweep& sweep, const std::optional<Vector6>& twist_base,
                                      std::optional<SourceId> without = {}) const;

  /// Whether any healthy source says that the robot moved since the last processed sweep.
  [[nodiscard]] bool saw_motion(const Sweep& sweep) const;

  /// Compares what each source predicted with what lidar found, and a constant velocity with what both know: it has to
  /// serve once the sources are lost. Gives back what lidar says of each source, and learns.
  std::array<LidarOpinion, kMaxSources> judge(const Sweep& sweep, const MotionPrior& prior, const SeenMotion& found,
                                              const SeenAxes& axes);

  /// In place of judge() where lidar found nothing: gyros that it has not taught yet learn what they read at rest from
  /// the best odometry source.
  void judge_blind(const Sweep& sweep);

  /// `sweep` has been processed: it is the last one now.
  void remember(const Sweep& sweep);

  [[nodiscard]] Stamp last_stamp() const { return last_stamp_; } ///< end of the last sweep
  [[nodiscard]] double elapsed_s(const Sweep& sweep) const { return to_seconds(sweep.end - last_stamp_); }

 private:
  [[nodiscard]] std::optional<Pose> step(const Sweep& sweep, SourceId source) const;
  [[nodiscard]] std::optional<Pose> healthy_step(const Sweep& sweep, SourceId source) const;

  std::vector<MotionSourceOptions> sources_;
  Fusion fusion_;
  NoSourcePrior no_source_prior_;
  Stamp last_stamp_;
  Duration last_period_{};
  std::array<SourcePose, kMaxSources> last_sources_;
  std::vector<PriorStatistics> statistics_; ///< by motion source
  PriorStatistics constant_velocity_statistics_;
  std::vector<GyroBias> gyro_biases_;
  std::vector<GyroScale> gyro_scales_;
  int judged_sweeps_ = 0; ///< by lidar; no more are counted than judge_blind() asks for
};

} // namespace locus
