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
#include "core/odometry/observed_axes.hpp"
#include "core/odometry/odometry_estimate.hpp"
#include "core/odometry/relocation.hpp"
#include "core/odometry/sensed_steps.hpp"
#include "core/sources/registration_feedback.hpp"

namespace locus {

/// Lidar odometry: the scan matching unit of LOCUS (paper II-B).
///
/// The filter predicts the motion, the motion sources measure it, and the sweep is registered with the submap (equation
/// 2): pose and twist jointly, with the filter's estimate as prior. If sources and surfaces disagree, other hypotheses
/// are tried (without one source, without any, at rest), and the likeliest is selected. The result depends on the
/// processed sweeps only. One owner.
class Odometry {
 public:
  /// `sources`: in order of priority, as in MotionSources.
  explicit Odometry(const OdometryOptions& options, const std::vector<MotionSourceOptions>& sources = {},
                    StageClock* clock = nullptr);

  /// Starts from `last` instead of level at the origin. Relocalises in `map_odom` (surfaces in the odom frame), if
  /// given. Waits up to 1 s for an odometry source that spans the gap, if there was one. If relocalisation fails,
  /// starts at the pose from such a source, or else level at the origin. Call before the first sweep.
  void begin_at(const ResumeState& last, std::span<const SurfacePoint> map_odom = {});

  /// Restores the calibration of the motion sources from another run that ended `elapsed_s` ago. Call before the first
  /// sweep.
  void recall(const LearnedSources& learned, double elapsed_s);

  /// Returns the estimate for the end of the sweep. Never fails: a sweep that cannot be registered yields the
  /// prediction, flagged. `stop` ends a registration early, except the one that relocalises.
  OdometryEstimate process(
      const Sweep& sweep, const Gicp::StopRequested& stop = [] { return false; });

  /// Prepares for the next sweep: inserts the last one into the map if it is a keyframe. Call it after the estimate is
  /// published; otherwise process() does this work first. The results are the same.
  void prepare_next();

  /// Returns the last sweep's evidence on the health of the motion sources.
  [[nodiscard]] const RegistrationFeedback& feedback() const { return feedback_; }

  /// Returns the map. It includes a keyframe after prepare_next().
  [[nodiscard]] const SurfaceMap& map() const { return map_; }

  /// Returns the points of the last sweep, fully de-skewed: base frame at its end, in the order of Sweep::points.
  [[nodiscard]] std::span<const SurfacePoint> scan() const { return scan_; }

  /// Returns the transform from the points of the ingest to those of scan().
  [[nodiscard]] const SweepCorrection& correction() const { return correction_; }

  /// Takes effect with the next sweep.
  void set_flat_ground(FlatGround mode) { flat_ground_ = FlatGroundAssumption(mode); }

 private:
  static constexpr std::size_t kMinPoints = 30;  ///< fewer do not constrain six axes reliably
  static constexpr double kMinInlierShare = 0.1; ///< least overlap of an accepted registration
  static constexpr std::bitset<kMaxSources> kAllSources{(1U << kMaxSources) - 1U};
  /// Prior odds, as twice their logarithm, that a source is right in a sweep: it is wrong once in a thousand.
  static constexpr double kSourceIsRight = 13.8;

  /// Changes of the yaw rate that are tried lie this far apart, and standard deviation of the rate about them. Larger
  /// steps are within reach of a registration but miss more turns, by nearer minima (docs/decisions/057).
  static constexpr double kTurnStep_radps = 0.6, kTurnSigma_radps = 0.6;
  static constexpr double kKeepsTurning = 9.2; ///< prior odds, as twice their logarithm, that none begins or ends

  /// An assumption on the motion during a sweep and on the sources that measure it.
  struct Assumption {
    std::bitset<kMaxSources> without{}; ///< excluded sources
    bool rests = false;                 ///< the robot stands
    bool slips = false;                 ///< a slip of the odometry begins
    double turn_radps = 0.0;            ///< change of the yaw rate, if a turn begins or ends
    bool continues = false;             ///< carried over from the last sweep
  };

  /// A motion hypothesis for one sweep, and its registration.
  struct Hypothesis : Assumption {
    SourceChoice choice;
    bool accepted = false; ///< the registration is accepted
    MotionFilter filter;   ///< before the update with lidar
    Registration scan_to_scan, fit;

    [[nodiscard]] MotionFilter updated() const;
  };

  /// A hypothesis that is less likely than the best one, and not excluded yet.
  struct Rival {
    Hypothesis hypothesis;
    double odds = 0.0;        ///< for it, of motion and prior, as twice their logarithm
    ObjectEvidence objects{}; ///< for it, of the points

    [[nodiscard]] double lead() const { return odds + total(objects); }
    void relate_to(const Rival& other);
  };

  /// The likeliest first. More than one, because the likeliest may be a slip from which nothing follows.
  using Rivals = std::array<std::optional<Rival>, 2>;

  /// The likeliest hypotheses for a sweep.
  struct Contest {
    Hypothesis best;
    Rivals rivals;

    void enter(Rival other);
  };

  /// The last change of the pose that an odometry reports, and the robot's position in the odom frame at that time.
  struct LastChange {
    Pose T_source_base;
    Eigen::Vector3d position_m;
    Eigen::Matrix3d covariance;
  };

  /// A source that contradicts all others.
  struct Contradiction {
    std::size_t source = 0;
    double evidence = 0.0; ///< largest squared innovation of an axis less the odds against a fault, both as -2 log
  };

  /// A hypothesis for the motion between the first two sweeps.
  struct Start {
    std::bitset<kMaxSources> without;
    bool rests = false;
    Vector6 twist_base = Vector6::Zero();
    Registration fit;
  };

  OdometryEstimate begin(const Sweep& sweep);
  bool relocalise_first(const Sweep& sweep);
  void find_start(const Sweep& sweep, const Gicp::StopRequested& stop);
  std::optional<Start> find_first_motion(const Sweep& first, const Sweep& sweep, const Gicp::StopRequested& stop);
  void begin_filter(const Pose& T_odom_first, const Start& start);
  void relocalise_again(const Sweep& first, const Sweep& sweep, const Start& start);
  [[nodiscard]] Start start_without(std::bitset<kMaxSources> without, const Sweep& first, const Sweep& sweep,
                                    const Gicp::StopRequested& stop);
  [[nodiscard]] SourceChoice choose_among(const Sweep& sweep, std::bitset<kMaxSources> without) const;
  [[nodiscard]] Vector6 twist_offset_after_drops(const Sweep& sweep) const;
  [[nodiscard]] Hypothesis assume(const Sweep& sweep, const Assumption& assumption, const MotionFilter& last) const;
  void match_last(const Sweep& sweep, const MotionBelief& belief, Hypothesis& hypothesis,
                  const Gicp::StopRequested& stop);
  [[nodiscard]] ElasticScan aged_scan(const Sweep& sweep, const Vector6& twist_base);
  void register_with(const Sweep& sweep, Hypothesis& hypothesis, const Gicp::StopRequested& stop);
  [[nodiscard]] static std::optional<SpecificForce> force_of(const Sweep& sweep, std::bitset<kMaxSources> without);
  [[nodiscard]] std::bitset<kMaxSources> repeating_sources(const Sweep& sweep) const;
  [[nodiscard]] std::optional<double> odds_against_stuck(std::bitset<kMaxSources> repeating) const;
  [[nodiscard]] double odds_of_sources(const Sweep& sweep, std::bitset<kMaxSources> without) const;
  [[nodiscard]] double contradictions(const Sweep& sweep, const Hypothesis& hypothesis,
                                      const MotionFilter& after) const;
  [[nodiscard]] double prior_odds(const Sweep& sweep, const Hypothesis& hypothesis, const MotionFilter& after) const;
  [[nodiscard]] Rival against(const Hypothesis& best, const Sweep& sweep, Hypothesis other) const;
  [[nodiscard]] bool may_slip(const Sweep& sweep, const SourceChoice& choice) const;
  void continue_rivals(const Sweep& sweep, Contest& contest, const Gicp::StopRequested& stop);
  void continue_rival(const Sweep& sweep, Rival& before, Contest& contest, const Gicp::StopRequested& stop);
  void consider_turns(const Sweep& sweep, Hypothesis& best, const Gicp::StopRequested& stop);
  std::optional<Registration> consider_faults(const Sweep& sweep, Contest& contest, const Gicp::StopRequested& stop);
  void consider_jump(const Sweep& sweep, Contest& contest, const Gicp::StopRequested& stop);
  [[nodiscard]] bool fits_by_chance(const Contest& contest) const;
  [[nodiscard]] bool is_lidar_wrong(const Sweep& sweep, const Contest& contest) const;
  [[nodiscard]] bool is_likelier(const Registration& at_rest, const Hypothesis& moving,
                                 std::optional<double> odds_against_stuck) const;
  std::optional<Hypothesis> consider_rest(const Sweep& sweep, const Hypothesis& moving,
                                          const Gicp::StopRequested& stop);
  Hypothesis attempt(const Sweep& sweep, const Assumption& assumption, const MotionFilter& last,
                     const Gicp::StopRequested& stop);
  [[nodiscard]] Hypothesis dead_reckoned(const Sweep& sweep, const Hypothesis& hypothesis) const;
  Hypothesis choose(const Sweep& sweep, const Gicp::StopRequested& stop);
  void apply_sources(MotionFilter& filter, const Sweep& sweep, const Hypothesis& hypothesis) const;
  void observe(const Sweep& sweep, const Hypothesis& best);
  void flatten(const Pose& T_odom_last, const Matrix12& information);
  void store_changes(const Sweep& sweep, bool returns);
  void follow_epoch(SourceId source, const SourcePose& sensed);
  void reset_source(SourceId source);
  void correct(const Sweep& sweep, const Vector6& twist_base, std::bitset<kMaxSources> without);
  void move_points(const Sweep& sweep, const SweepCorrection& correction);
  [[nodiscard]] std::optional<Contradiction> worst_source(const Sweep& sweep, const Hypothesis& hypothesis) const;
  [[nodiscard]] bool is_accepted(const Sweep& sweep, const Registration& fit, const Hypothesis& all_sources) const;
  void report(const Sweep& sweep, OdometryEstimate& estimate);
  static void follow_lateness(const Learned& late_s, Duration& applied_lateness);
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
  ObservedAxes observed_axes_;
  SensedSteps steps_;
  MotionFilter filter_;
  std::array<std::optional<LastChange>, kMaxSources> last_changes_; ///< empty before the first pose of a source
  Rivals rivals_;                                                   ///< their filters include the update with lidar
  std::optional<MotionFilter> observer_; ///< calibrates sources whose result is only reported, never used
  SweepCorrection correction_;           ///< de-skew of the current sweep
  std::vector<SurfacePoint> scan_;       ///< points of the current sweep, fully de-skewed
  AgedScan aged_;                        ///< the points of scan_ to be registered, by age
  std::optional<Sweep> first_;           ///< first sweep, until the second one arrives
  std::bitset<kMaxSources> recalled_;    ///< sources restored from another run and not received yet
  std::array<std::optional<std::uint32_t>, kMaxSources> epochs_; ///< last known epoch of each source
  std::array<Stamp, kMaxSources> learned_since_{};
  std::optional<ResumeState> start_;              ///< starting pose
  std::optional<ResumeState> run_before_;         ///< end of the last run, if the first sweep was found in its map
  bool continues_motion_ = false;                 ///< the run before ended in motion
  std::optional<Stamp> waits_since_;              ///< start of the wait for an odometry source that spans the gap
  std::optional<Matrix6> keyframe_observability_; ///< of the last sweep, if it is a keyframe that is not in the map yet
  std::optional<Beginning> beginning_;
  bool stands_ = false, registered_ = false;
  std::optional<bool> shapeless_;    ///< ElasticScan::shapeless of the current sweep, the same for all hypotheses
  bool scan_is_next_target_ = false; ///< the last sweep is to become the target of scan-to-scan
  bool has_last_scan_ = false;       ///< scan-to-scan has a target
  Stamp slow_since_;
  RegistrationFeedback feedback_;
  std::array<SourceReport, kMaxSources> source_reports_{};
};

} // namespace locus
