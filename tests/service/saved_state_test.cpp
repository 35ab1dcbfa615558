// SPDX-License-Identifier: Apache-2.0
#include "daemon/service/saved_state.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <fstream>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "daemon/service/state_saver.hpp"
#include "replay/replay_run.hpp"
#include "support/errors.hpp"
#include "support/patience.hpp"

namespace locus::daemon {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

/// A state saver that is fed by the test. The ground mode is part of the map state and not of the resume state, and so
/// tells when the map state was last written.
class StateSaverTest : public testing::Test {
 protected:
  void update(Duration after_start, double x_m, FlatGround mode, bool has_begun = true) {
    OdometryEstimate estimate;
    estimate.stamp = stamp_from_ns(1'700'000'000'000'000'000) + after_start;
    estimate.T_odom_base.translation.x() = x_m;
    estimate.twist_base[0] = 1.5;
    if (has_begun)
      estimate.beginning = Beginning::origin;
    saver_.update(odometry_, estimate, mode);
  }

  /// Writes the pending state, then returns whether the file contains these values.
  [[nodiscard]] bool says(double x_m, FlatGround mode) {
    saver_.write();
    const auto state = load_state(file_);
    return state && state->last.T_odom_base.translation.x() == x_m && state->flat_ground == mode;
  }

  test::TemporaryFolder folder_;
  std::filesystem::path file_ = folder_ / "state";
  Odometry odometry_{OdometryOptions{}};
  StateSaver saver_{file_, {}, [](const std::string& problem) { ADD_FAILURE() << problem; }};
};

TEST_F(StateSaverTest, WritesTheMapEveryThirtySecondsOrTenMetresAndThePoseAlways) {
  update(seconds{0}, 0, FlatGround::off, false);
  saver_.write();
  EXPECT_FALSE(std::filesystem::exists(file_)) << "nothing was seen yet";
  update(seconds{1}, 1, FlatGround::off);
  EXPECT_TRUE(says(1, FlatGround::off));
  update(seconds{2}, 10.5, FlatGround::on);
  EXPECT_TRUE(says(10.5, FlatGround::off));
  update(seconds{3}, 11.5, FlatGround::on);
  EXPECT_TRUE(says(11.5, FlatGround::on)) << "ten metres on";
  update(seconds{32}, 12, FlatGround::automatic);
  EXPECT_TRUE(says(12, FlatGround::on));
  update(seconds{34}, 12.5, FlatGround::automatic);
  EXPECT_TRUE(says(12.5, FlatGround::automatic)) << "thirty seconds later";
  saver_.reset(std::nullopt);
  update(seconds{35}, 0, FlatGround::off);
  EXPECT_TRUE(says(0, FlatGround::off)) << "at once";
}

TEST_F(StateSaverTest, ResetDiscardsTheStateAndStoresTheGivenPose) {
  update(seconds{0}, 3, FlatGround::off);
  ASSERT_TRUE(says(3, FlatGround::off));
  const SavedState told{{Stamp{}, Pose{Eigen::Quaterniond::Identity(), {7, 0, 0}}}, FlatGround::on, {}};
  saver_.reset(told);
  EXPECT_FALSE(saver_.last());
  EXPECT_EQ(load_state(file_)->last.T_odom_base.translation.x(), 7) << "at once";
  for (const bool was_written : {false, true}) {
    update(seconds{1}, 8, FlatGround::off);
    if (was_written)
      saver_.write();
    saver_.reset(std::nullopt);
    saver_.write();
    EXPECT_FALSE(std::filesystem::exists(file_)) << was_written;
  }
  update(seconds{2}, 9, FlatGround::off);
  EXPECT_TRUE(says(9, FlatGround::off));
}

TEST(StateSaverFailure, IsReportedOnceUntilAStateIsSaved) {
  const test::TemporaryFolder folder;
  const std::filesystem::path missing = folder / "missing";
  std::vector<std::string> problems;
  StateSaver saver{missing / "state", {}, [&](const std::string& problem) { problems.push_back(problem); }};
  const Odometry odometry{OdometryOptions{}};
  OdometryEstimate estimate;
  estimate.beginning = Beginning::origin;
  const auto save_three = [&] {
    for (int i = 0; i < 3; ++i) {
      estimate.stamp += 2 * StateSaver::kPeriod;
      saver.update(odometry, estimate, FlatGround::off);
      saver.write();
    }
  };
  save_three();
  EXPECT_EQ(problems.size(), 1U);
  EXPECT_TRUE(contains(problems.at(0), "make its folder writable")) << problems.at(0);
  std::filesystem::create_directory(missing);
  save_three();
  EXPECT_EQ(problems.size(), 1U);
  std::filesystem::remove_all(missing);
  save_three();
  EXPECT_EQ(problems.size(), 2U);
}

TEST_F(StateSaverTest, WritesFromAnotherThreadDuringUpdates) {
  Worker disk("disk", milliseconds{1}, [this](bool /*last*/) { saver_.write(); });
  constexpr int kSweeps = 200;
  for (int sweep = 0; sweep <= kSweeps; ++sweep)
    update(milliseconds{100 * sweep}, sweep, FlatGround::off);
  const auto give_up = std::chrono::steady_clock::now() + test::patience();
  std::optional<double> x_m;
  while (x_m != kSweeps && std::chrono::steady_clock::now() < give_up)
    if (const auto state = load_state(file_))
      x_m = state->last.T_odom_base.translation.x();
  EXPECT_EQ(x_m, kSweeps);
}

TEST_F(StateSaverTest, ClockSetBackDelaysNoWrite) {
  update(seconds{0}, 1, FlatGround::off);
  ASSERT_TRUE(says(1, FlatGround::off));
  update(-seconds{10}, 2, FlatGround::on);
  EXPECT_TRUE(says(2, FlatGround::off)) << "the resume state";
  update(-std::chrono::hours{1}, 3, FlatGround::on);
  EXPECT_TRUE(says(3, FlatGround::on)) << "and the map";
}

TEST_F(StateSaverTest, MovingRobotIsPredictedForAMoment) {
  update(seconds{0}, 3, FlatGround::off);
  ASSERT_TRUE(says(3, FlatGround::off));
  const ResumeState last = load_state(file_)->last;
  const auto x_m = [&](Duration later) { return last.extrapolated_to(last.stamp + later).translation.x(); };
  EXPECT_NEAR(x_m(seconds{1}), 4.5, 1e-9);
  EXPECT_NEAR(x_m(seconds{60}), 6, 1e-9);
  EXPECT_NEAR(x_m(-seconds{1}), 3, 1e-9) << "clocks are set";
}

TEST_F(StateSaverTest, JumpOfTheTwistIsNotExtrapolated) {
  OdometryEstimate estimate;
  estimate.beginning = Beginning::origin;
  for (int sweep = 0; sweep < 5; ++sweep) {
    estimate.stamp = stamp_from_ns(1'700'000'000'000'000'000) + milliseconds{100 * sweep};
    saver_.update(odometry_, estimate, FlatGround::off);
  }
  const Stamp later = estimate.stamp + seconds{2};
  estimate.stamp += milliseconds{100};
  estimate.twist_base[0] = -0.8;
  saver_.update(odometry_, estimate, FlatGround::off);
  ASSERT_TRUE(saver_.last());
  EXPECT_LT(saver_.last()->extrapolated_to(later).translation.norm(), 0.5) << "of a motion that is believed";
  estimate.stamp += milliseconds{100};
  estimate.twist_covariance.diagonal().setConstant(0.5 * 0.5);
  saver_.update(odometry_, estimate, FlatGround::off);
  EXPECT_LT(saver_.last()->extrapolated_to(later).translation.norm(), 0.5) << "and of one that is not";
}

/// Drivers are stopped before the service.
TEST_F(StateSaverTest, LearnedCalibrationOutlivesSilenceOfItsSource) {
  OdometryEstimate estimate;
  estimate.stamp = stamp_from_ns(1);
  estimate.beginning = Beginning::origin;
  estimate.sources[1].learned.emplace().states[LearnedSource::kLate] = 0.02;
  saver_.update(odometry_, estimate, FlatGround::off);
  estimate.stamp += milliseconds{100};
  estimate.sources[1].learned.reset();
  saver_.update(odometry_, estimate, FlatGround::off);
  ASSERT_TRUE(saver_.last() && saver_.last()->learned[1]);
  EXPECT_EQ(saver_.last()->learned[1]->lateness_s().mean, 0.02);
  EXPECT_FALSE(saver_.last()->learned[0]);
}

TEST_F(StateSaverTest, CovarianceAfterMinutesOfDeadReckoningIsValid) {
  SavedState state;
  state.last.pose_covariance = Vector6(1e12, 1e12, 1e12, 1, 1, 1).asDiagonal();
  state.last.pose_covariance(0, 1) = state.last.pose_covariance(1, 0) = 1e12 * (1 + 1e-9); // rounding error
  ASSERT_FALSE(write_state(file_, state));
  ASSERT_TRUE(load_state(file_));
  state.last.pose_covariance(0, 1) = state.last.pose_covariance(1, 0) = 2e12;
  ASSERT_FALSE(write_state(file_, state));
  EXPECT_FALSE(load_state(file_)) << "no covariance is like that";
}

TEST_F(StateSaverTest, LearnedCalibrationIsRestored) {
  SavedState state;
  LearnedSource& learned = state.last.learned[1].emplace();
  learned.noise_per_s = Vector6::LinSpaced(0.1, 0.6);
  learned.states = {0.1, 0.02, 0.003, 0.0004, 0.05, -0.06, 0.07};
  learned.covariance.diagonal().setLinSpaced(1e-4, 7e-4);
  ASSERT_FALSE(write_state(file_, state));
  const auto read = load_state(file_);
  ASSERT_TRUE(read);
  EXPECT_FALSE(read->last.learned[0]);
  ASSERT_TRUE(read->last.learned[1]);
  EXPECT_EQ(read->last.learned[1]->noise_per_s, learned.noise_per_s);
  EXPECT_EQ(read->last.learned[1]->states, learned.states);
  EXPECT_EQ(read->last.learned[1]->covariance, learned.covariance);
  learned.covariance(0, 0) = -1e-4;
  ASSERT_FALSE(write_state(file_, state));
  EXPECT_FALSE(load_state(file_)->last.learned[1]) << "no covariance is like that";
  learned.covariance(0, 0) = 1e-4;
  learned.noise_per_s[3] = 0.0;
  ASSERT_FALSE(write_state(file_, state));
  EXPECT_FALSE(load_state(file_)->last.learned[1]) << "nothing is without noise";
  learned.noise_per_s[3] = 0.1;
  learned.states[0] = -1.0;
  ASSERT_FALSE(write_state(file_, state));
  EXPECT_FALSE(load_state(file_)->last.learned[1]) << "no wheels report nothing of their way";
}

/// Learned values are corrections of configured ones, and are discarded with them.
TEST_F(StateSaverTest, LearnedCalibrationIsDiscardedIfReconfigured) {
  std::vector<MotionSource> sources(2);
  sources[0].name = "wio";
  sources[1].name = "imu";
  sources[1].kind = SourceKind::imu;
  SavedState state;
  state.sources = ids_of(sources);
  for (std::size_t i = 0; i < 2; ++i) {
    state.last.T_source_base[i] = Pose{};
    state.last.learned[i].emplace().since = stamp_from_ns(7);
    state.last.learned[i]->noise_per_s.setOnes();
  }
  ASSERT_FALSE(write_state(file_, state));
  auto same = load_state(file_);
  ASSERT_TRUE(same);
  EXPECT_EQ(same->sources, state.sources);
  same->reset_changed_sources(ids_of(sources));
  ASSERT_TRUE(same->last.learned[0] && same->last.learned[1]);
  EXPECT_EQ(same->last.learned[1]->since, stamp_from_ns(7));

  const auto left_after = [&](const std::function<void(MotionSource&)>& change) {
    std::vector<MotionSource> changed = sources;
    change(changed[1]);
    SavedState left = state;
    left.reset_changed_sources(ids_of(changed));
    EXPECT_EQ(left.last.learned[0].has_value(), changed[1].name == "imu") << "the other one";
    return left.last.learned[1].has_value();
  };
  EXPECT_FALSE(left_after([](MotionSource& imu) { imu.late_ms = 5; }));
  EXPECT_FALSE(left_after([](MotionSource& imu) { imu.T_base_source.rotation = from_rpy_rad({0, 0.01, 0}); }));
  EXPECT_FALSE(left_after([](MotionSource& imu) { imu.name = "gyro"; }));
  EXPECT_FALSE(left_after([](MotionSource& imu) { imu.calibration = Calibration::off; }));
  EXPECT_FALSE(left_after([](MotionSource& imu) { imu.calibration_sigma.mounting_deg = 0.0; }));
  EXPECT_TRUE(left_after([](MotionSource& imu) { imu.health_topic = "/health"; }));
}

TEST_F(StateSaverTest, EveryDamagedByteIsDetected) {
  const test::TemporaryFolder memory{"/dev/shm"}; // no disk latency, thousands of times
  const std::filesystem::path file = memory / "state";
  SavedState state;
  state.last.T_source_base[1] = Pose{};
  state.last.doubted.set(1);
  state.map_odom.resize(3, {Eigen::Vector3f::Ones(), Eigen::Vector3f::UnitZ()});
  ASSERT_FALSE(write_state(file, state));
  state.last.T_odom_base.translation.x() = 5;
  update_resume_state(file, state.last);
  ASSERT_TRUE(load_state(file));
  const std::string whole = test::read_text(file);
  std::size_t refused = 0;
  for (std::size_t i = 0; i < whole.size(); ++i) {
    std::string damaged = whole;
    damaged[i] = static_cast<char>(damaged[i] ^ 4);
    std::ofstream{file} << damaged;
    const auto left = load_state(file);
    refused += left ? 0U : 1U;
    if (left) { // from the other of two copies of the resume state
      EXPECT_EQ(left->last.T_source_base[1]->translation, Eigen::Vector3d::Zero()) << i;
      EXPECT_TRUE(left->last.T_odom_base.translation.x() == 0 || left->last.T_odom_base.translation.x() == 5) << i;
      EXPECT_EQ(left->map_odom.size(), 3U) << i;
    }
    std::ofstream{file} << whole.substr(0, i);
    EXPECT_FALSE(load_state(file)) << i;
  }
  EXPECT_GT(refused, 3 * sizeof(SurfacePoint)) << "all of the map";
}

/// Power fails while the resume state is written: only this many bytes are new.
TEST_F(StateSaverTest, TruncatedPoseUpdateLosesNoMap) {
  const test::TemporaryFolder memory{"/dev/shm"};
  const std::filesystem::path file = memory / "state";
  SavedState state;
  state.map_odom.resize(3, {Eigen::Vector3f::Ones(), Eigen::Vector3f::UnitZ()});
  ASSERT_FALSE(write_state(file, state));
  const auto x_m = [&]() -> std::optional<double> {
    const auto loaded = load_state(file);
    return loaded && loaded->map_odom.size() == 3 ? std::optional{loaded->last.T_odom_base.translation.x()}
                                                  : std::nullopt;
  };
  for (int sweep = 1; sweep <= 3; ++sweep) {
    const std::string before = test::read_text(file);
    state.last.T_odom_base.translation.x() = sweep;
    update_resume_state(file, state.last);
    ASSERT_EQ(x_m(), sweep);
    const std::string after = test::read_text(file);
    ASSERT_EQ(after.size(), before.size());
    for (std::size_t written = 0; written < after.size(); written += 13) {
      std::ofstream{file} << after.substr(0, written) + before.substr(written);
      const auto found = x_m();
      EXPECT_TRUE(found == sweep - 1 || found == sweep) << written << " bytes of sweep " << sweep;
    }
    std::ofstream{file} << after;
  }
}

} // namespace
} // namespace locus::daemon
