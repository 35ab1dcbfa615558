// SPDX-License-Identifier: Apache-2.0
#include "locus_experiments/harsh_figures.hpp"

#include <fstream>
#include <functional>

#include <gtest/gtest.h>

#include "replay/replay_run.hpp"

namespace locus::experiments {
namespace {

constexpr int kSweeps = 100; // ten a second

/// A drive along x: two seconds at rest, then 1 m/s.
class HarshFigures : public testing::Test {
 protected:
  nlohmann::ordered_json figures(const std::function<double(double)>& error_m,
                                 const std::function<bool(double)>& flagged, const std::string& log = "",
                                 double mounting_rad = 0) {
    std::ofstream truth{folder_ / "gt.tum"}, odometry{folder_ / "odometry.tum"}, csv{folder_ / "odometry.csv"};
    csv << "t_ns,state,source,iterations,inliers,36 covariances\n";
    for (int sweep = 0; sweep <= kSweeps; ++sweep) {
      const double t_s = 0.1 * sweep, x_m = std::max(0.0, t_s - 2);
      truth << 100 + t_s << ' ' << x_m << " 0 0 0 0 0 1\n";
      odometry << 100 + t_s << ' ' << x_m + error_m(t_s) << " 0 0 0 0 0 1\n";
      csv << sweep << (flagged(t_s) ? ",dead_reckoning" : ",tracking") << ",wio,1,1";
      for (int entry = 0; entry < 36; ++entry)
        csv << ",0";
      csv << '\n';
    }
    truth.close();
    odometry.close();
    csv.close();
    std::ofstream{folder_ / "log"} << log;
    CaptureFolder capture;
    capture.ground_truth = folder_ / "gt.tum";
    return harsh_figures(folder_.path(), capture, {{"sources", sources_}}, mounting_rad);
  }

  nlohmann::ordered_json sources_ = nlohmann::ordered_json::object();

 private:
  test::TemporaryFolder folder_;
};

double none(double) { return 0; }
bool never(double) { return false; }

TEST_F(HarshFigures, DriveNearTheTruthIsNotLost) {
  const auto found = figures(none, never);
  EXPECT_TRUE(found["standing"]);
  EXPECT_NEAR(found["true_mps"].get<double>(), 1.0, 1e-6);
  EXPECT_TRUE(found["lost_after_s"].is_null());
  EXPECT_TRUE(found["flagged_after_s"].is_null());
}

TEST_F(HarshFigures, FlagBeforeTheLossDoesNotCount) {
  const auto lost_at_6 = [](double t_s) { return t_s < 5.95 ? 0.02 * t_s : 0.4; };
  const auto found = figures(lost_at_6, [](double t_s) { return t_s < 5 || t_s > 8.45; });
  EXPECT_NEAR(found["lost_after_s"].get<double>(), 6.0, 1e-6);
  EXPECT_NEAR(found["flagged_after_s"].get<double>(), 2.5, 1e-6);
  EXPECT_TRUE(figures(lost_at_6, [](double t_s) { return t_s < 5; })["flagged_after_s"].is_null());
}

/// At 1 m/s from 2 s on, a heading error of 0.01 rad amounts to 20 mm after 4 s.
TEST_F(HarshFigures, MountingErrorOfTheLidarIsNoLoss) {
  const auto askew = [](double t_s) { return t_s < 3.95 ? 0.0 : 0.29 + 0.01 * (t_s - 2); };
  EXPECT_NEAR(figures(askew, never)["lost_after_s"].get<double>(), 4.0, 1e-6);
  EXPECT_TRUE(figures(askew, never, "", 0.01)["lost_after_s"].is_null());
}

TEST_F(HarshFigures, WarningsAreListedOnceWithoutNumbers) {
  sources_ = {{"wio", {{"received", 100}, {"health_changes", 2}}}, {"imu", {{"received", 0}, {"health_changes", 1}}}};
  const auto found = figures(none, never,
                             "locus-replay: warning: wio is off by 3.25 m\nlocus-replay: warning: wio is off by 17 m\n"
                             "recording 20 s\n");
  EXPECT_EQ(found["said"], (nlohmann::ordered_json{"wio is off by # m", "wio was lost"}));
}

} // namespace
} // namespace locus::experiments
