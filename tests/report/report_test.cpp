// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/report.hpp"

#include <cmath>
#include <fstream>
#include <iterator>
#include <numeric>

#include <gtest/gtest.h>

#include "locus_replay/quantiles.hpp"
#include "locus_replay/report_map.hpp"
#include "locus_replay/report_series.hpp"
#include "sample_run.hpp"
#include "support/temporary_file.hpp"

namespace locus::tools {
namespace {

using nlohmann::json;
using nlohmann::ordered_json;
using test::SampleRun;

std::string written(const SampleRun& run) {
  const test::TemporaryFile file("report.html");
  write_report(file.path(), run.report());
  std::ifstream stream{file.path(), std::ios::binary};
  return {std::istreambuf_iterator<char>{stream}, {}};
}

/// Returns the run as a browser parses it: up to the first text that ends a script element.
json run_in(const std::string& page) {
  const std::string begin = R"(<script type="application/json" id="run">)";
  const std::size_t first = page.find(begin) + begin.size();
  return json::parse(page.substr(first, page.find("</script", first) - first));
}

TEST(Quantiles, AreTheValuesOfTheNearestRank) {
  const Quantiles quantiles({5.0, 1.0, 4.0, 2.0, 3.0});
  EXPECT_EQ(quantiles.at(0.5), 3.0);
  EXPECT_EQ(quantiles.at(0.61), 4.0);
  EXPECT_EQ(quantiles.at(0.0), 1.0);
  EXPECT_EQ(quantiles.at(1.0), 5.0);
  EXPECT_EQ(Quantiles({}).at(0.5), 0.0);
}

TEST(ReportSeries, RetainsThePeaksOfAnHour) {
  std::vector<Sample> samples(36'000, Sample{0.0, 1.0});
  for (std::size_t i = 0; i < samples.size(); ++i)
    samples[i].t_s = 0.1 * static_cast<double>(i);
  samples[12'345].value = 9.0;
  samples[12'346].value = -9.0;
  const ordered_json columns = series(samples, 0.1);
  const auto v = columns["v"].get<std::vector<double>>(), t = columns["t"].get<std::vector<double>>();
  EXPECT_LE(v.size(), 2 * kSeriesBuckets);
  EXPECT_TRUE(std::is_sorted(t.begin(), t.end()));
  const auto peak = std::find(v.begin(), v.end(), 9.0);
  ASSERT_NE(peak, v.end());
  EXPECT_EQ(t[static_cast<std::size_t>(peak - v.begin())], 1234.5);
  EXPECT_EQ(*std::next(peak), -9.0) << "the order of the two is kept";
}

TEST(ReportSeries, FewSamplesAreUnchangedExceptNonFiniteOnes) {
  const std::vector<Sample> samples{{0.0, 0.12345}, {0.1, std::nan("")}, {0.2, HUGE_VAL}, {0.3, 0.2}};
  EXPECT_EQ(series(samples, 0.001).dump(), R"({"t":[0.0,0.3],"v":[0.123,0.2]})");
  EXPECT_EQ(series({}, 0.001).dump(), R"({"t":[],"v":[]})");
}

TEST(ReportSeries, PathOfAnHourIsThinnedAndRetainsBothEnds) {
  std::vector<PathPoint> points;
  for (int i = 0; i < 360'000; ++i)
    points.push_back({0.01 * i, Eigen::Vector3d{50.0 * std::cos(1e-3 * i), 50.0 * std::sin(1e-3 * i), 0.0}});
  const ordered_json columns = path(points);
  EXPECT_LE(columns["t"].size(), kPathPoints + 2);
  EXPECT_GT(columns["t"].size(), kPathPoints / 4);
  EXPECT_EQ(columns["t"].front(), 0.0);
  EXPECT_EQ(columns["t"].back(), 3599.99);
  EXPECT_EQ(columns["x"].size(), columns["t"].size());
}

TEST(ReportSeries, RobotAtRestHasTwoPoints) {
  const std::vector<PathPoint> points(1000, PathPoint{1.0, Eigen::Vector3d{1.0, 2.0, 3.0}});
  EXPECT_EQ(path(points).dump(), R"({"t":[1.0,1.0],"x":[1.0,1.0],"y":[2.0,2.0],"z":[3.0,3.0]})");
  EXPECT_EQ(path({})["t"].size(), 0U);
}

TEST(ReportSeries, BandHasOnlyChangesAndRetainsShortFailures) {
  const std::vector<BandSample> few{{0.0, 2}, {0.1, 2}, {0.2, 0}, {0.3, 2}};
  EXPECT_EQ(band(few).dump(), R"({"t":[0.0,0.2,0.3],"what":[2,0,2]})");
  std::vector<BandSample> many(36'000, BandSample{0.0, 2});
  many[20'001].what = 0;
  EXPECT_EQ(band(many)["what"].dump(), "[2,0,2]");
}

TEST(ReportMap, TilesHaveTheDocumentedLayout) {
  const std::vector<SurfacePoint> surfaces{{{0.0F, 0.0F, 0.0F}, {0.0F, 0.0F, 1.0F}},
                                           {{2.0F, 0.0F, 1.0F}, {-1.0F, 0.0F, 0.0F}}};
  const ordered_json map = map_tiles(surfaces, {});
  EXPECT_EQ(map["count"], 2);
  EXPECT_EQ(map["tile_m"], 0.5);
  EXPECT_EQ(map["origin_m"].dump(), "[1.0,0.0,0.5]");
  EXPECT_EQ(map["step_m"].get<float>(), 1e-3F);
  // -1000, 0, -500, then up (0, 0); 1000, 0, 500, then (-127, 0).
  EXPECT_EQ(map["data"], "GPwAAAz+AADoAwAA9AGBAA==");
}

TEST(ReportMap, NormalsFaceTheNearestViewpoint) {
  const std::vector<SurfacePoint> ceiling{{{0.0F, 0.0F, 3.0F}, {0.0F, 0.0F, 1.0F}}};
  const std::vector<Eigen::Vector3f> below{{0.0F, 0.0F, 1.0F}}, above{{0.0F, 0.0F, 9.0F}};
  EXPECT_EQ(map_tiles(ceiling, above)["data"], "AAAAAAAAAAA=");
  EXPECT_EQ(map_tiles(ceiling, below)["data"], "AAAAAAAAgYE=") << "straight down is the corner of the octahedron";
}

TEST(ReportMap, ExcessSurfacesAreThinnedEvenly) {
  std::vector<SurfacePoint> floor;
  for (int x = 0; x < 800; ++x) {
    for (int y = 0; y < 800; ++y)
      floor.push_back({{0.5F * static_cast<float>(x), 0.5F * static_cast<float>(y), 0.0F}, {0.0F, 0.0F, 1.0F}});
  }
  const ordered_json map = map_tiles(floor, {});
  EXPECT_LE(map["count"], kMapTiles);
  EXPECT_GT(map["count"], kMapTiles / 3);
  const double covered_m2 = map["count"].get<double>() * std::pow(map["tile_m"].get<double>(), 2);
  EXPECT_NEAR(covered_m2, 400.0 * 400.0, 0.2 * 400.0 * 400.0) << "the tiles are as large as what they stand for";
}

TEST(ReportMap, WithoutFinitePointsIsEmpty) {
  EXPECT_EQ(map_tiles({}, {})["count"], 0);
  const std::vector<SurfacePoint> broken{{{NAN, 0.0F, 0.0F}, {0.0F, 0.0F, 1.0F}}};
  EXPECT_EQ(map_tiles(broken, {})["count"], 0);
}

TEST(ReportMap, FloorInRingsIsShownByThePlanesOfTheCoarseMap) {
  SurfaceMap map(10'000'000);
  std::vector<SurfacePoint> ring; // one line of points in each fine voxel: no plane there, but one in the coarse voxel
  for (const float y : {-0.5F, 0.0F, 0.5F}) {
    for (float x = -0.7F; x < 0.7F; x += 0.01F)
      ring.push_back({{x, y, 0.0F}, Eigen::Vector3f::Zero()});
  }
  map.insert(ring, Pose{});
  for (std::size_t slot = 0; slot < map.fine().size(); ++slot)
    ASSERT_FALSE(map.fine().surface(slot).planar());
  const std::vector<SurfacePoint> visible = visible_surfaces(map);
  ASSERT_EQ(visible.size(), 9U);
  for (const SurfacePoint& surface : visible)
    EXPECT_NEAR(std::abs(surface.normal.z()), 1.0F, 1e-3F);
}

TEST(SweepRecord, HasTheRoleOfEachSource) {
  daemon::ProcessedSweep sweep;
  sweep.raw_returns = 1000;
  sweep.usable_sources = 0b0111;
  sweep.estimate.prior = {{SourceId{2}, SourceId{0}}};
  sweep.estimate.pose_covariance.diagonal() << 0.01, 0.02, 0.06, 9.0, 9.0, 9.0;
  const SweepRecord record = record_of(sweep);
  EXPECT_EQ(record.sources[0], SourceHealth::used);
  EXPECT_EQ(record.sources[1], SourceHealth::healthy);
  EXPECT_EQ(record.sources[2], SourceHealth::used);
  EXPECT_EQ(record.sources[3], SourceHealth::lost);
  EXPECT_EQ(record.lidars, SourceHealth::used);
  EXPECT_NEAR(record.std_m, 0.3, 1e-12);
  sweep.estimate.failed = true;
  EXPECT_EQ(record_of(sweep).lidars, SourceHealth::healthy);
  sweep.raw_returns = 0;
  EXPECT_EQ(record_of(sweep).lidars, SourceHealth::lost);
}

TEST(Report, OfAnHourIsSmallerThanTenMegabytes) {
  const std::string page = written(SampleRun::of(std::chrono::hours{1}, "hour"));
  RecordProperty("bytes", static_cast<int>(page.size()));
  EXPECT_LT(page.size(), 10'000'000U);
}

TEST(Report, TimesAreThoseOfTheCapture) {
  SampleRun run = SampleRun::bare();
  run.capture_start -= std::chrono::seconds{60};
  const json shown = run_in(written(run));
  EXPECT_EQ(shown["path"]["t"].dump(), "[60.0,60.1,60.2]");
  EXPECT_EQ(shown["state"]["t"].front(), 60.0);
}

TEST(Report, NamesCannotEndTheScript) {
  const std::string hostile = "</script><script>alert(1)</script><!--";
  SampleRun run = SampleRun::bare();
  run.summary["capture"] = hostile;
  const std::string page = written(run);
  EXPECT_EQ(run_in(page)["summary"]["capture"], hostile);
  EXPECT_EQ(page.find("alert(1)</script>"), std::string::npos);
}

TEST(Report, HasSummaryConfigurationAndTruthInTheFrameOfTheEstimate) {
  SampleRun run = SampleRun::of(std::chrono::minutes{1}, "minute");
  const Pose T_other_truth{from_rpy_rad({0.0, 0.0, 1.0}), {1000.0, -2000.0, 30.0}};
  std::vector<StampedPose> estimates;
  for (const SweepRecord& sweep : run.sweeps)
    estimates.push_back({sweep.stamp, sweep.T_odom_base});
  for (StampedPose& pose : run.truth)
    pose.T_source_base = T_other_truth * pose.T_source_base;
  run.accuracy = trajectory_accuracy(estimates, run.truth);
  const json shown = run_in(written(run));
  EXPECT_EQ(shown["summary"], json(run.summary));
  EXPECT_NE(shown["config"].get<std::string>().find("motion_sources"), std::string::npos);
  EXPECT_NEAR(shown["truth"]["x"].front().get<double>(), run.sweeps.front().T_odom_base.translation.x(), 0.02);
  EXPECT_NEAR(shown["truth"]["y"].back().get<double>(), run.sweeps.back().T_odom_base.translation.y(), 0.02);
  EXPECT_EQ(shown["error_boxes"].size(), 6U);
  EXPECT_EQ(shown["health"].size(), 1 + run.config.motion_sources.size());
  EXPECT_EQ(shown["stages"].size(), kStages);
}

TEST(Report, WithoutTruthHasNoErrors) {
  const json shown = run_in(written(SampleRun::bare()));
  EXPECT_FALSE(shown.contains("truth"));
  EXPECT_FALSE(shown.contains("error_boxes"));
  EXPECT_FALSE(shown["series"].contains("error_m"));
  EXPECT_TRUE(shown["series"].contains("std_m"));
}

TEST(Report, LoadsNothingFromTheNetwork) {
  const std::string page = written(SampleRun::bare());
  for (const char* loading : {" src=", "@import", "url(http", "<link rel=\"stylesheet"})
    EXPECT_EQ(page.find(loading), std::string::npos) << loading;
  EXPECT_NE(page.find("default-src 'none'"), std::string::npos);
}

} // namespace
} // namespace locus::tools
