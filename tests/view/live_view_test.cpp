// SPDX-License-Identifier: Apache-2.0
#include "locusctl/view/live_view.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <numbers>
#include <string>
#include <string_view>
#include <vector>

namespace locus::tools {
namespace {

using nlohmann::json;

const Eigen::Vector3f kUp{0, 0, 1};

/// Parts of an answer.
struct Answer {
  json header;
  std::vector<float> tiles, path, sweep; ///< x y z; the normals of the tiles are left out

  explicit Answer(const std::string& bytes) {
    std::uint32_t length = 0;
    std::memcpy(&length, bytes.data(), sizeof(length));
    EXPECT_EQ(length % 4, 0U) << "the records are aligned";
    header = json::parse(bytes.substr(sizeof(length), length));
    std::size_t at = sizeof(length) + length;
    const auto read = [&](std::vector<float>& out, std::size_t count, std::size_t bytes_each) {
      for (std::size_t i = 0; i < count; ++i, at += bytes_each) {
        out.resize(out.size() + 3);
        std::memcpy(out.data() + out.size() - 3, bytes.data() + at, 3 * sizeof(float));
      }
    };
    read(tiles, header["tiles"]["count"], 16);
    read(path, header["path"]["count"], 12);
    read(sweep, header.contains("sweep") ? header["sweep"]["count"].get<std::size_t>() : 0, 12);
    EXPECT_EQ(at, bytes.size());
  }

  [[nodiscard]] LiveView::Known known() const {
    return {header["epoch"], header["tiles"]["from"].get<std::size_t>() + header["tiles"]["count"].get<std::size_t>(),
            header["path"]["from"].get<std::size_t>() + header["path"]["count"].get<std::size_t>(),
            header["sweep"]["sequence"]};
  }
};

/// Returns a sweep at (x, 0, 0) that shows one surface a metre to the left of the robot.
LiveSweep sweep_at(float x, std::uint64_t sequence, std::int64_t run = 7) {
  return {run, sequence, {Eigen::Quaterniond::Identity(), {static_cast<double>(x), 0, 0}}, {{{0, 1, 0}, {0, -1, 0}}}};
}

TEST(TileMap, VoxelHasOneTile) {
  TileMap map;
  EXPECT_FALSE(map.add({{1.01F, 0, 0}, kUp}));
  EXPECT_FALSE(map.add({{1.02F, 0, 0}, kUp}));
  EXPECT_FALSE(map.add({{1.30F, 0, 0}, kUp}));
  EXPECT_EQ(map.tiles().size(), 2U);
}

TEST(TileMap, PointsWithoutNormalOrPositionAreLeftOut) {
  TileMap map;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  for (const SurfacePoint& point : {SurfacePoint{{nan, 0, 0}, kUp}, SurfacePoint{{1, 0, 0}, {0, 0, 0}},
                                    SurfacePoint{{2, 0, 0}, {nan, 0, 0}}, SurfacePoint{{INFINITY, 0, 0}, kUp}})
    EXPECT_FALSE(map.add(point));
  EXPECT_TRUE(map.tiles().empty());
}

TEST(TileMap, FullMapGetsLargerTilesAndStaysBounded) {
  TileMap map;
  bool is_replaced = false;
  for (int i = 0; i < 400; ++i)
    for (int k = 0; k < 1000; ++k) {
      is_replaced = map.add({{0.25F * static_cast<float>(i) + 0.1F, 0.25F * static_cast<float>(k) + 0.1F, 0}, kUp}) ||
                    is_replaced;
      ASSERT_LE(map.tiles().size(), TileMap::kMaxTiles);
    }
  EXPECT_TRUE(is_replaced);
  EXPECT_GT(map.tile_m(), TileMap::kFinestTile_m);
  EXPECT_GT(map.tiles().size(), TileMap::kMaxTiles / 3) << "no coarser than necessary";
  EXPECT_GT(map.tiles().back().position_m.x(), 99.0F) << "the latest part is shown";
}

TEST(DrivenPath, RobotThatStandsAddsNothing) {
  DrivenPath path;
  for (int i = 0; i < 1000; ++i)
    path.add({0.01F * static_cast<float>(i % 2), 0, 0});
  EXPECT_EQ(path.positions_m().size(), 1U);
  EXPECT_EQ(path.length_m(), 0.0);
}

TEST(DrivenPath, LongPathStaysBoundedFromStartToEnd) {
  DrivenPath path;
  bool is_replaced = false;
  constexpr int kSteps = 50'000;
  for (int i = 0; i <= kSteps; ++i) {
    is_replaced = path.add({0.1F * static_cast<float>(i), 0, 0}) || is_replaced;
    ASSERT_LE(path.positions_m().size(), DrivenPath::kMaxPositions);
  }
  EXPECT_TRUE(is_replaced);
  EXPECT_EQ(path.positions_m().front().x(), 0.0F);
  EXPECT_NEAR(path.positions_m().back().x(), 0.1 * kSteps, 1.0);
  EXPECT_NEAR(path.length_m(), 0.1 * kSteps, 1.0);
}

TEST(LiveView, PageReceivesEverythingOnceAndThenWhatIsNew) {
  LiveView view(1000);
  EXPECT_TRUE(view.add(sweep_at(0, 1)));
  const Answer first(view.answer({}));
  EXPECT_EQ(first.tiles, (std::vector<float>{0, 1, 0}));
  EXPECT_EQ(first.path, (std::vector<float>{0, 0, 0}));
  EXPECT_EQ(first.sweep, (std::vector<float>{0, 1, 0}));
  const Answer nothing(view.answer(first.known()));
  EXPECT_TRUE(nothing.tiles.empty() && nothing.path.empty() && nothing.sweep.empty());
  EXPECT_FALSE(view.add(sweep_at(2, 2)));
  const Answer more(view.answer(nothing.known()));
  EXPECT_EQ(more.tiles, (std::vector<float>{2, 1, 0}));
  EXPECT_EQ(more.path, (std::vector<float>{2, 0, 0}));
  EXPECT_EQ(more.sweep, (std::vector<float>{2, 1, 0}));
  const Answer other_page(view.answer({}));
  EXPECT_EQ(other_page.tiles.size(), 6U);
  EXPECT_EQ(other_page.path.size(), 6U);
}

TEST(LiveView, PoseRotatesPointsAndNormalsIntoTheOdomFrame) {
  LiveView view(1);
  LiveSweep sweep = sweep_at(5, 1);
  sweep.T_odom_base.rotation = Eigen::AngleAxisd(std::numbers::pi / 2, Eigen::Vector3d::UnitZ());
  view.add(sweep);
  const Answer answer(view.answer({}));
  EXPECT_NEAR(answer.tiles[0], 4, 1e-6);
  EXPECT_NEAR(answer.tiles[1], 0, 1e-6);
}

TEST(LiveView, AnotherRunVoidsWhatThePageHas) {
  LiveView view(1);
  view.add(sweep_at(0, 1));
  view.add(sweep_at(3, 2));
  const Answer before(view.answer({}));
  EXPECT_TRUE(view.add(sweep_at(9, 1, 8)));
  const Answer after(view.answer(before.known()));
  EXPECT_NE(after.header["epoch"], before.header["epoch"]);
  EXPECT_EQ(after.header["tiles"]["from"], 0);
  EXPECT_EQ(after.tiles, (std::vector<float>{9, 1, 0}));
  EXPECT_EQ(after.path, (std::vector<float>{9, 0, 0}));
}

TEST(LiveView, MissedSweepsAreCountedAndRepeatedOnesAreNot) {
  LiveView view(1);
  for (const std::uint64_t sequence : {10U, 11U, 11U, 15U})
    view.add(sweep_at(0, sequence));
  EXPECT_EQ(Answer(view.answer({})).header["sweep"]["missed"], 3);
}

TEST(LiveView, LargeMapIsSentInParts) {
  LiveView view(1);
  LiveSweep sweep = sweep_at(0, 1);
  sweep.points_base.clear();
  for (int i = 0; i < 50'000; ++i)
    sweep.points_base.push_back({{static_cast<float>(i), 0, 0}, kUp});
  view.add(sweep);
  LiveView::Known known;
  std::size_t tiles = 0, answers = 0;
  do {
    const Answer part(view.answer(known));
    EXPECT_LE(part.tiles.size(), 3 * LiveView::kTilesPerAnswer);
    EXPECT_LE(part.sweep.size(), 3 * LiveView::kMaxSweepPoints);
    tiles += part.tiles.size() / 3;
    known = part.known();
    ++answers;
  } while (tiles < 50'000 && answers < 10);
  EXPECT_EQ(tiles, 50'000U);
  EXPECT_EQ(answers, 3U);
}

TEST(LiveView, MapOfTheServiceFacesTheRobot) {
  LiveView view(1);
  view.add(sweep_at(0, 1));
  const std::vector<SurfacePoint> planes{{{0, 0, 3}, kUp}};
  view.add_map(planes);
  const std::string bytes = view.answer({});
  const Answer answer(bytes);
  ASSERT_EQ(answer.tiles.size(), 15U) << "four tiles of a plane of half a metre, and one of the sweep";
  const std::size_t last = bytes.size() - answer.path.size() * 4 - answer.sweep.size() * 4 - 16;
  for (const std::size_t part : {last + 12, last + 13})
    EXPECT_EQ(std::abs(static_cast<signed char>(bytes[part])), 127) << "octahedral: straight down is every corner";
}

TEST(LiveView, ProblemIsShownUntilTheNextStatus) {
  LiveView view(1);
  view.set_problem("no service");
  EXPECT_EQ(Answer(view.answer({})).header["problem"], "no service");
  view.set_status({{"state", "tracking"}});
  const Answer answer(view.answer({}));
  EXPECT_EQ(answer.header["problem"], "");
  EXPECT_EQ(answer.header["status"]["state"], "tracking");
}

TEST(LiveView, ImpossibleQueriesAreHarmless) {
  LiveView view(1);
  view.add(sweep_at(0, 1));
  LiveView::Known known = Answer(view.answer({})).known();
  known.tiles = known.positions = std::numeric_limits<std::size_t>::max();
  const Answer answer(view.answer(known));
  EXPECT_TRUE(answer.tiles.empty() && answer.path.empty());
}

TEST(ReadSweep, MalformedAnswersAreRejected) {
  const nlohmann::ordered_json good{
      {"sweep", {{"run", 1}, {"sequence", 2}, {"xyz_m", {1, 2, 3}}, {"quaternion_xyzw", {0, 0, 0, 1}}}}};
  const std::vector<std::byte> bytes(2 * sizeof(SurfacePoint) + 5);
  const auto sweep = read_sweep(good, bytes);
  ASSERT_TRUE(sweep);
  EXPECT_EQ(sweep->points_base.size(), 2U);
  EXPECT_EQ(sweep->T_odom_base.translation, Eigen::Vector3d(1, 2, 3));
  EXPECT_FALSE(read_sweep({}, bytes));
  for (const char* key : {"run", "sequence", "xyz_m", "quaternion_xyzw"}) {
    nlohmann::ordered_json bad = good;
    bad["sweep"][key] = "?";
    EXPECT_FALSE(read_sweep(bad, bytes)) << key;
    bad["sweep"].erase(key);
    EXPECT_FALSE(read_sweep(bad, bytes)) << key;
  }
}

} // namespace
} // namespace locus::tools
