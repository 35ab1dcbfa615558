// SPDX-License-Identifier: Apache-2.0
#include "locus_experiments/fault_figures.hpp"

#include <fstream>
#include <functional>
#include <vector>

#include <gtest/gtest.h>

#include "replay/replay_run.hpp"

namespace locus::experiments {
namespace {

constexpr int kSeconds = 20;

/// One pose per second along x at 1 m/s, displaced by `error_m`.
std::vector<StampedPose> drive(const std::function<double(int)>& error_m) {
  std::vector<StampedPose> poses;
  for (int second = 0; second <= kSeconds; ++second)
    poses.push_back(
        {Stamp{from_seconds(100 + second)}, {Eigen::Quaterniond::Identity(), {second + error_m(second), 0.0, 0.0}}});
  return poses;
}

void save(const std::filesystem::path& file, const std::vector<StampedPose>& poses) {
  std::ofstream stream{file};
  for (const StampedPose& pose : poses)
    stream << to_seconds(pose.stamp.time_since_epoch()) << ' ' << pose.T_source_base.translation.x()
           << " 0 0 0 0 0 1\n";
}

TEST(ErrorAdded, IsMeasuredWithinTheInterval) {
  const auto truth = drive([](int) { return 0.0; });
  const auto estimates = drive([](int second) { return 0.5 + (second > 10 ? 0.1 * std::min(second - 10, 5) : 0.0); });
  EXPECT_NEAR(error_added_m(estimates, truth, {2, 9}), 0.0, 1e-9);
  EXPECT_NEAR(error_added_m(estimates, truth, {9, 12}), 0.2, 1e-9);
  EXPECT_NEAR(error_added_m(estimates, truth, {10, 100}), 0.5, 1e-9) << "as far as the estimates go";
}

TEST(FaultFigures, HaveFlagsGrowthAndSourceErrors) {
  const test::TemporaryFolder folder;
  save(folder / "gt.tum", drive([](int) { return 0.0; }));
  save(folder / "odometry.tum", drive([](int) { return 0.0; }));
  save(folder / "wio.tum", drive([](int second) { return 0.01 * second; }));
  std::ofstream{folder / "lidar.pcap"} << "";
  std::ofstream csv{folder / "odometry.csv"};
  csv << "t_ns,state,source,iterations,inliers,36 covariances\n";
  for (int second = 0; second <= kSeconds; ++second) {
    csv << second << (second >= 15 ? ",degenerate" : ",tracking") << ",wio,1,1";
    for (int entry = 0; entry < 36; ++entry)
      csv << ',' << (entry == 0 ? second : entry == 7 ? 2 : 0);
    csv << '\n';
  }
  csv.close();
  const auto capture = CaptureFolder::find(folder.path());
  ASSERT_TRUE(capture) << capture.error();
  CaptureFolder sources = *capture;
  std::erase_if(sources.odometry, [](const CaptureFolder::Source& source) { return source.name != "wio"; });

  const auto figures = fault_figures({10, 20}, folder.path(), sources);
  EXPECT_NEAR(figures["length_m"].get<double>(), 20.0, 1e-9);
  EXPECT_NEAR(figures["added_m"].get<double>(), 0.0, 1e-9);
  EXPECT_NEAR(figures["told"].get<double>(), 6.0 / 11.0, 1e-9) << "since the interval's beginning";
  EXPECT_NEAR(figures["growth"]["along"].get<double>(), 4.0, 1e-9) << "from 5 m to 20 m";
  EXPECT_NEAR(figures["growth"]["across"].get<double>(), 1.0, 1e-9);
  EXPECT_NEAR(figures["sources"]["wio"]["added_m"].get<double>(), 0.1, 1e-9);
  EXPECT_GT(figures["sources"]["wio"]["ape_mean_m"].get<double>(), 0.02);
}

} // namespace
} // namespace locus::experiments
