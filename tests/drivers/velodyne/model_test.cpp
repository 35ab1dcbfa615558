// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "core/base/pose.hpp"
#include "drivers/velodyne/model.hpp"

namespace locus::velodyne {
namespace {

using std::chrono::microseconds;
using std::chrono::nanoseconds;

double elevation_deg(Model model, std::size_t laser) {
  return spec(model).calibration.storage[laser].elevation_rad / kRadPerDeg;
}

TEST(VelodyneModel, NamesAndProductIdsReadBack) {
  for (const Model model : kModels) {
    EXPECT_EQ(model_from_string(to_string(model)), model);
    EXPECT_EQ(model_from_product_id(spec(model).product_id), model);
  }
  EXPECT_EQ(model_from_string("VLP-17"), std::nullopt);
  EXPECT_EQ(model_from_product_id(0x00), std::nullopt);
}

TEST(VelodyneModel, RingsCountTheLasersUpwards) {
  for (const Model model : kModels) {
    std::set<std::pair<int, double>> by_ring;
    for (const Laser& laser : spec(model).calibration.lasers())
      by_ring.emplace(laser.ring, laser.elevation_rad);
    ASSERT_EQ(by_ring.size(), spec(model).calibration.laser_count) << to_string(model);
    EXPECT_EQ(by_ring.begin()->first, 0);
    EXPECT_TRUE(std::is_sorted(by_ring.begin(), by_ring.end(), [](const auto& a, const auto& b) {
      return a.second < b.second;
    })) << to_string(model);
  }
}

TEST(VelodyneModel, OutermostLasersMatchTheManuals) {
  const auto range = [](Model model) {
    const auto lasers = spec(model).calibration.lasers();
    const auto [low, high] = std::minmax_element(
        lasers.begin(), lasers.end(), [](const auto& a, const auto& b) { return a.elevation_rad < b.elevation_rad; });
    return std::pair{elevation_deg(model, static_cast<std::size_t>(low - lasers.begin())),
                     elevation_deg(model, static_cast<std::size_t>(high - lasers.begin()))};
  };
  const auto expect_range = [&](Model model, double low, double high) {
    EXPECT_NEAR(range(model).first, low, 1e-9) << to_string(model);
    EXPECT_NEAR(range(model).second, high, 1e-9) << to_string(model);
  };
  expect_range(Model::vlp16, -15.0, 15.0);
  expect_range(Model::puck_hi_res, -10.0, 10.0);
  expect_range(Model::vlp32c, -25.0, 15.0);
  expect_range(Model::hdl32e, -30.67, 10.67);
  expect_range(Model::vls128, -25.0, 15.0);
}

TEST(VelodyneModel, PacketsLastAsLongAsTheirFirings) {
  EXPECT_EQ(packet_duration(Model::vlp16, ReturnMode::strongest), nanoseconds{24 * 55'296});
  EXPECT_EQ(packet_duration(Model::vlp16, ReturnMode::dual), nanoseconds{12 * 55'296});
  EXPECT_EQ(packet_duration(Model::vlp32c, ReturnMode::last), nanoseconds{12 * 55'296});
  EXPECT_EQ(packet_duration(Model::hdl32e, ReturnMode::strongest), nanoseconds{552'960});
  EXPECT_EQ(packet_duration(Model::hdl32e, ReturnMode::dual), nanoseconds{276'480});
  EXPECT_EQ(packet_duration(Model::vls128, ReturnMode::strongest), nanoseconds{3 * 53'300});
  EXPECT_EQ(packet_duration(Model::vls128, ReturnMode::dual), nanoseconds{53'300});
}

TEST(VelodyneModel, FiringsFallIntoTheirColumnInOrder) {
  for (const Model model : kModels) {
    const auto firings = spec(model).firings();
    EXPECT_EQ(firings.front().offset_ns, 0);
    EXPECT_TRUE(std::is_sorted(firings.begin(), firings.end(),
                               [](const Firing& a, const Firing& b) { return a.offset_ns < b.offset_ns; }));
    EXPECT_LT(nanoseconds{firings.back().offset_ns}, spec(model).column_duration);
  }
}

TEST(VelodyneModel, Vls128OfLaterFirmwareFiresAtASlowerPace) {
  EXPECT_EQ(packet_duration(Model::vls128, ReturnMode::strongest, Pace::slower), nanoseconds{3 * 55'277});
  EXPECT_EQ(packet_duration(Model::vls128, ReturnMode::dual, Pace::slower), nanoseconds{55'277});
  const auto firings = spec(Model::vls128, Pace::slower).firings();
  EXPECT_EQ(firings[24].offset_ns, 3 * 2'890) << "the fourth group, which the stamp names: 8.7 us";
  EXPECT_EQ(firings[127].offset_ns, 16 * 2'890);
  EXPECT_EQ(&spec(Model::vlp16, Pace::slower), &spec(Model::vlp16));
}

TEST(VelodyneModel, Vls128PausesAfterTheEighthGroup) {
  const auto firings = spec(Model::vls128).firings();
  EXPECT_EQ(firings[63].offset_ns, 7 * 2'665);
  EXPECT_EQ(firings[64].offset_ns, 9 * 2'665);
  EXPECT_EQ(firings[127].offset_ns, 16 * 2'665);
}

} // namespace
} // namespace locus::velodyne
