// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/base/options.hpp"
#include "core/base/stage_clock.hpp"
#include "core/ingest/sweep.hpp"
#include "core/map/registration.hpp"
#include "core/map/surface_map.hpp"
#include "core/odometry/flat_ground.hpp"
#include "core/odometry/gravity.hpp"
#include "core/odometry/odometry_estimate.hpp"
#include "core/odometry/pose_uncertainty.hpp"
#include "core/odometry/seen_axes.hpp"
#include "core/odometry/sensor_integration.hpp"
#include "core/odometry/standstill.hpp"
#include "core/sources/registration_feedback.hpp"

namespace locus {

/// The scan matching unit of LOCUS (paper II-B): sweeps in, odometry out.
///
/// Each sweep is registered with the one before (equation 1) and with the submap (equation 2), starting from what the
/// motion sources say. The prior is not only the start: it takes part in the registration with the weight it has proved
/// to deserve, so an axis that the points do not see falls back to it by itself. The result depends on the sweeps that
/// were processed and on nothing else. One owner.
class Odometry {
 public:
  /// `sources` in the order of their priority, as MotionSources has them.
  explicit Odometry(const OdometryOptions& options, const std::vector<MotionSourceOptions>& sources = {},
                    StageClock* clock = nullptr);

  /// Before the first sweep: where it is to be, instead of level at the origin. With surfaces that were seen there
  /// before (odom frame) it is registered with them; where it does not fit it begins level at the origin all the same.
  void begin_at(const Pose& T_odom_base, std::span<const SurfacePoint> map_odom = {});

  /// Whether the first sweep was found in the surfaces that it was to begin with.
  [[nodiscard]] bool resumed() const { return resumed_; }

  /// The estimate for the end of the sweep. Never fails: a sweep that cannot be registered yields the prediction,
  /// flagged. `stop` ends a registration early, but for the one that finds where to go on.
  OdometryEstimate process(
      const Sweep& sweep, const Gicp::StopRequested& stop = [] { return false; });

  /// What the next sweep needs of the last one: the map takes in a keyframe, and scan-to-scan gets its target. For when
  /// the estimate is on its way; what is not done here, process() does before it begins. The results are the same.
  void prepare_next();

  /// What the sweep processed last says of the motion sources, for their health.
  [[nodiscard]] const RegistrationFeedback& feedback() const { return feedback_; }

  /// A keyframe is in it from prepare_next() on.
  [[nodiscard]] const SurfaceMap& map() const { return map_; }

  /// The points of the sweep processed last, fully corrected: base frame at its end, in the order of Sweep::points.
  [[nodiscard]] std::span<const SurfacePoint> scan() const { return last_scan_; }

  /// From the next sweep on.
  void set_flat_ground(FlatGround mode) { flat_ground_ = FlatGroundAssumption(mode); }

 private:
  OdometryEstimate begin(const Sweep& sweep);
  [[nodiscard]] std::optional<Vector6> kept_twist(const Sweep& sweep) const;
  MotionPrior settle_dispute(const Sweep& sweep, const MotionPrior& prior, const Gicp::StopRequested& stop);
  Registration attempt(const Sweep& sweep, const Pose& T_last_now, const Gicp::StopRequested& stop);
  void correct_motion(const Sweep& sweep, const Pose& T_last_now);
  [[nodiscard]] Vector6 twist_in(const Sweep& sweep, const Pose& T_last_now) const;
  void correct(const Sweep& sweep, const Vector6& twist_base, std::vector<SurfacePoint>& scan) const;
  Registration match_scan(const MotionPrior& prior, const Pose& T_start, bool wide, const Gicp::StopRequested& stop);
  Registration match_submap(const MotionPrior& prior, const Pose& T_last_now, const Gicp::StopRequested& stop);
  void begin_again(const Sweep& sweep, const MotionPrior& prior, Registration& found, const Gicp::StopRequested& stop);
  [[nodiscard]] Pose flatten(const Pose& T_last_now, const Matrix6& information_odom) const;
  void predict(const MotionPrior& prior);
  [[nodiscard]] Matrix6 covariance_of(const MotionPrior& prior) const;
  [[nodiscard]] Vector6 variance_against_submap() const;
  [[nodiscard]] bool trusts(const Registration& registration, const Pose& T_last_now, const Pose& T_last_predicted,
                            const Vector6& variance) const;
  [[nodiscard]] bool is_outvoted(const Sweep& sweep, const Registration& registration, const Pose& T_last_now,
                                 const MotionPrior& prior) const;
  [[nodiscard]] bool was_seen_lately(Stamp now) const;
  [[nodiscard]] bool had_sight(const Sweep& sweep) const;
  [[nodiscard]] bool is_fragment(const Sweep& sweep) const;
  [[nodiscard]] bool misses_most(const Registration& registration) const;
  [[nodiscard]] double share_of_inliers(const Registration& registration) const;
  [[nodiscard]] std::span<const SurfacePoint> registered() const { return std::span(scan_).first(registered_); }
  [[nodiscard]] bool needs_scan_to_scan(const MotionPrior& prior) const;
  void map_last_scan(std::size_t points);
  [[nodiscard]] bool is_map_in_doubt() const;
  void choose_keyframe(OdometryEstimate& estimate);
  static Matrix6 share_of_map(double fresh, const Matrix6& observability);
  void hold_still(const Sweep& sweep, OdometryEstimate& estimate);
  void settle(const Sweep& sweep, const MotionPrior& prior, OdometryEstimate& estimate);
  [[nodiscard]] Pose motion(const Pose& T_last_now, const Pose& T_last_seen) const;
  void bend(const Vector6& surprise);
  void observe(OdometryEstimate& estimate);
  void move_on(const Pose& T_last_now, const Matrix6& covariance_odom, OdometryEstimate& estimate);
  void finish(const Sweep& sweep, const MotionPrior& prior, OdometryEstimate& estimate);

  OdometryOptions options_;
  StageClock* clock_;
  Gicp gicp_;
  Gravity gravity_;
  TiltKeeper tilt_keeper_;
  FlatGroundAssumption flat_ground_;
  SurfaceMap map_;
  SurfaceMap last_scan_map_;       ///< the last processed sweep alone, the target of scan-to-scan
  bool last_scan_mapped_ = false;  ///< last_scan_map_ is up to date
  std::vector<SurfacePoint> scan_; ///< the sweep at hand, fully corrected
  std::size_t registered_ = 0;     ///< the first so many points of scan_ are registered
  std::vector<SurfacePoint> last_scan_;
  std::size_t last_registered_ = 0;
  SensorIntegration sensors_;

  std::uint64_t processed_ = 0;
  std::optional<Pose> T_odom_start_; ///< where to begin
  Sweep first_; ///< as it came, while no velocity was known to correct it with; else without points
  Pose T_odom_last_;
  Vector6 twist_base_ = Vector6::Zero();
  Pose T_odom_keyframe_;
  std::optional<Matrix6> keyframe_observability_; ///< of the last sweep, if the map is still to take it in
  PoseUncertainty uncertainty_;
  Vector6 askew_variance_ = Vector6::Zero(); ///< of the last sweep, base axes
  Standstill standstill_;
  double usual_share_ = 0.0;  ///< of the registered points that find a correspondence
  double usual_points_ = 0.0; ///< of a sweep
  Stamp last_seen_;           ///< of the last sweep that lidar placed
  int refused_in_a_row_ = 0;  ///< sweeps with points
  std::int64_t fitted_ = 0;   ///< sweeps, since the map was begun
  bool lacks_prior_ = false;  ///< the last sweep had to be registered with the one before it
  bool adrift_ = false;       ///< the last sweep was a prediction
  bool knows_start_ = false;  ///< the map holds what was seen at T_odom_start_
  bool resumed_ = false;
  bool source_is_refuted_ = false; ///< that of the rotation of the sweep at hand, which came corrected for it
  SeenAxes seen_axes_;
  RegistrationFeedback feedback_;
};

} // namespace locus
