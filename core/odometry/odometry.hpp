// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <bitset>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/base/options.hpp"
#include "core/base/stage_clock.hpp"
#include "core/ingest/deskew.hpp"
#include "core/ingest/sweep.hpp"
#include "core/map/registration.hpp"
#include "core/map/surface_map.hpp"
#include "core/odometry/aged_scan.hpp"
#include "core/odometry/flat_ground.hpp"
#include "core/odometry/free_space.hpp"
#include "core/odometry/gravity.hpp"
#include "core/odometry/lidar_health.hpp"
#include "core/odometry/map_policy.hpp"
#include "core/odometry/motion_filter.hpp"
#include "core/odometry/odometry_estimate.hpp"
#include "core/odometry/relocation.hpp"
#include "core/odometry/seen_axes.hpp"
#include "core/odometry/sensed_steps.hpp"
#include "core/sources/registration_feedback.hpp"

namespace locus {

/// The scan matching unit of LOCUS (paper II-B): sweeps in, odometry out.
///
/// The filter predicts the motion, the motion sources measure it, and the sweep is registered with the submap (equation
/// 2) from there: pose and twist together, against what is known of both. Where sources and surfaces do not fit, other
/// hypotheses are tried (without a source, free, at rest), and the likeliest is taken. The result depends on the sweeps
/// that were processed and on nothing else. One owner.
class Odometry {
 public:
  /// `sources` in the order of their priority, as MotionSources has them.
  explicit Odometry(const OdometryOptions& options, const std::vector<MotionSourceOptions>& sources = {},
                    StageClock* clock = nullptr);

  /// Before the first sweep: where the robot was, instead of level at the origin. With surfaces that were seen there
  /// (odom frame) it is looked for among them. Where they leave a doubt that waits a second at the most for an odometry
  /// that can tell how far it has come since; where it is not found it begins where such an odometry says, or level at
  /// the origin all the same.
  void begin_at(const Whereabouts& last, std::span<const SurfacePoint> map_odom = {});

  /// Before the first sweep: what another run has learned of the motion sources, that ended `elapsed_s` ago.
  void recall(const LearnedSources& learned, double elapsed_s);

  /// The estimate for the end of the sweep. Never fails: a sweep that cannot be registered yields the prediction,
  /// flagged. `stop` ends a registration early, but for the one that finds where to go on.
  OdometryEstimate process(
      const Sweep& sweep, const Gicp::StopRequested& stop = [] { return false; });

  /// What the next sweep needs of the last one: the map takes in a keyframe. For when the estimate is on its way; what
  /// is not done here, process() does before it begins. The results are the same.
  void prepare_next();

  /// What the sweep processed last says of the motion sources, for their health.
  [[nodiscard]] const RegistrationFeedback& feedback() const { return feedback_; }

  /// A keyframe is in it from prepare_next() on.
  [[nodiscard]] const SurfaceMap& map() const { return map_; }

  /// The points of the sweep processed last, fully corrected: base frame at its end, in the order of Sweep::points.
  [[nodiscard]] std::span<const SurfacePoint> scan() const { return scan_; }

  /// What moved them there from where the ingest had put them.
  [[nodiscard]] const SweepCorrection& correction() const { return correction_; }

  /// From the next sweep on.
  void set_flat_ground(FlatGround mode) { flat_ground_ = FlatGroundAssumption(mode); }

 private:
  static constexpr std::size_t kMinPoints = 30; ///< fewer say nothing reliable about six axes
  static constexpr std::bitset<kMaxSources> kAllSources{(1U << kMaxSources) - 1U};
  /// Twice the logarithm of the odds, before a look at the surfaces: that a source is right in a sweep (one in a
  /// thousand is not), and that a robot stands in its first two sweeps.
  static constexpr double kSourceIsRight = 13.8, kBeginsAtRest = 20.0;

  /// What may be true of a sweep, and what the surfaces say of it.
  struct Hypothesis {
    std::bitset<kMaxSources> without; ///< sources that are not believed
    bool rests = false;
    bool placed = false; ///< what the surfaces say is believed
    SourceChoice choice;
    MotionFilter filter; ///< before it sees
    Registration scan_to_scan, fit;
  };

  /// A source that contradicts what all others say.
  struct Contradiction {
    std::size_t source = 0;
    double test_ratio = 0.0;
  };

  /// What may be true of the first two sweeps.
  struct Start {
    std::bitset<kMaxSources> without;
    bool rests = false;
    Vector6 twist_base = Vector6::Zero();
    Registration fit;
  };

  OdometryEstimate begin(const Sweep& sweep);
  bool find_again(const Sweep& sweep);
  void find_start(const Sweep& sweep, const Gicp::StopRequested& stop);
  std::optional<Start> find_first_motion(const Sweep& first, const Sweep& sweep, const Gicp::StopRequested& stop);
  void begin_filter(const Pose& T_odom_first, const Start& start);
  void find_once_more(const Sweep& first, const Sweep& sweep, const Start& start);
  [[nodiscard]] Start start_without(std::bitset<kMaxSources> without, const Sweep& first, const Sweep& sweep,
                                    const Gicp::StopRequested& stop);
  [[nodiscard]] SourceChoice choose_among(const Sweep& sweep, std::bitset<kMaxSources> without) const;
  [[nodiscard]] Vector6 unlike_mean(const Sweep& sweep) const;
  [[nodiscard]] Hypothesis assume(const Sweep& sweep, std::bitset<kMaxSources> without, bool rests) const;
  void match_last(const Sweep& sweep, const MotionBelief& belief, Hypothesis& hypothesis,
                  const Gicp::StopRequested& stop);
  void register_with(const Sweep& sweep, Hypothesis& hypothesis, const Gicp::StopRequested& stop);
  [[nodiscard]] static std::optional<SpecificForce> force_of(const Sweep& sweep, std::bitset<kMaxSources> without);
  [[nodiscard]] double odds_of_sources(const Sweep& sweep, std::bitset<kMaxSources> without) const;
  std::optional<Registration> consider_faults(const Sweep& sweep, Hypothesis& best, const Gicp::StopRequested& stop);
  Hypothesis attempt(const Sweep& sweep, std::bitset<kMaxSources> without, bool rests, const Gicp::StopRequested& stop);
  Hypothesis choose(const Sweep& sweep, const Gicp::StopRequested& stop);
  void tell(MotionFilter& filter, const Sweep& sweep, const Hypothesis& hypothesis) const;
  void observe(const Sweep& sweep, const Hypothesis& best);
  void follow_epoch(SourceId source, const SourcePose& sensed);
  void forget(SourceId source);
  void correct(const Sweep& sweep, const Vector6& twist_base, std::bitset<kMaxSources> without);
  void move_points(const Sweep& sweep, const SweepCorrection& correction);
  [[nodiscard]] std::optional<Contradiction> worst_source(const Sweep& sweep, const Hypothesis& hypothesis) const;
  [[nodiscard]] bool is_placed(const Sweep& sweep, const Registration& fit, const Hypothesis& all_sources) const;
  void report(const Sweep& sweep, OdometryEstimate& estimate);
  static void follow_lateness(const Learned& late_s, Duration& taken_out);
  void report_sources(const Sweep& sweep, OdometryEstimate& estimate);
  void finish(const Sweep& sweep, OdometryEstimate& estimate);

  OdometryOptions options_;
  std::vector<MotionSourceOptions> sources_;
  StageClock* clock_;
  Gicp gicp_;
  Gravity gravity_;
  TiltKeeper tilt_keeper_;
  FlatGroundAssumption flat_ground_;
  SurfaceMap map_;
  SurfaceMap last_scan_map_; ///< target of scan-to-scan
  FreeSpace free_space_;
  MapPolicy map_policy_;
  LidarHealth lidar_health_;
  SeenAxes seen_axes_;
  SensedSteps steps_;
  MotionFilter filter_;
  std::optional<MotionFilter> observer_; ///< of sources that are only reported on; tells nobody of the robot
  SweepCorrection correction_;           ///< of the sweep at hand
  std::vector<SurfacePoint> scan_;       ///< the same, fully corrected
  AgedScan aged_;                        ///< what is registered of it
  std::optional<Sweep> first_;           ///< while no motion is known
  std::bitset<kMaxSources> recalled_;    ///< sources known from another run, and not heard yet
  std::array<std::optional<std::uint32_t>, kMaxSources> epochs_; ///< of each source, when it was heard last
  std::array<Stamp, kMaxSources> learned_since_{};
  std::optional<Whereabouts> start_;              ///< where to begin
  std::optional<Whereabouts> run_before_;         ///< where it ended, if the first sweep was found in its map
  std::optional<Stamp> waits_since_;              ///< for an odometry that can tell where that is
  std::optional<Matrix6> keyframe_observability_; ///< of the last sweep, if the map is still to take it in
  std::optional<Beginning> beginning_;
  bool stands_ = false, saw_ = false;
  bool scan_is_next_target_ = false; ///< scan-to-scan is to take in the last sweep
  bool has_last_scan_ = false;       ///< it has taken in one
  Stamp slow_since_;
  RegistrationFeedback feedback_;
  std::array<SourceReport, kMaxSources> source_reports_{};
};

} // namespace locus
