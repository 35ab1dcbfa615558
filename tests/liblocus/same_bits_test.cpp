// SPDX-License-Identifier: Apache-2.0
// The library's estimates equal locus-replay's bit by bit: fed by packets, by clouds and by recordings.
#include <algorithm>
#include <cstring>
#include <filesystem>
#include <functional>
#include <thread>

#include <gtest/gtest.h>

#include "estimate_text.hpp"
#include "fed_recording.hpp"
#include "replay/replay_run.hpp"
#include "replay/sweep_folders.hpp"
#include "support/clouds.hpp"
#include "support/pcd_text.hpp"
#include "support/test_data.hpp"
#include "support/test_drives.hpp"

namespace locus::test {
namespace {

using liblocus::Estimate;
using std::filesystem::path;

const std::vector<std::string> kNoSources{"motion_sources=[]"};

std::vector<Estimate> replay(const path& recording, const std::vector<std::string>& overrides = {}) {
  liblocus::Replay replay(recording, {.overrides = overrides});
  std::vector<Estimate> estimates;
  while (std::optional<Estimate> estimate = replay.next())
    estimates.push_back(*std::move(estimate));
  return estimates;
}

Replay program(const path& recording, const std::vector<std::string>& overrides = {}) {
  std::vector<std::string> arguments{recording.string()};
  for (const std::string& override : overrides)
    arguments.insert(arguments.end(), {"--set", override});
  return Replay(arguments);
}

/// Compares every number of every estimate.
void expect_same(const std::vector<Estimate>& estimates, const Replay& program) {
  ASSERT_EQ(program.run().status, 0) << program.run().err;
  const std::vector<std::string> poses = lines_of(read_text(program.file("odometry.tum")));
  const std::vector<std::string> table = lines_of(read_text(program.file("odometry.csv")));
  ASSERT_GE(poses.size(), 2U);
  ASSERT_EQ(estimates.size(), poses.size());
  ASSERT_EQ(estimates.size() + 1, table.size());
  for (std::size_t i = 0; i < estimates.size(); ++i) {
    ASSERT_EQ(tum_row(estimates[i]), poses[i]) << "sweep " << i;
    ASSERT_EQ(csv_row(estimates[i]), table[i + 1]) << "sweep " << i;
  }
}

template <class Surfaces> void expect_same_map(const Surfaces& surfaces, const Replay& program) {
  const std::string map = read_text(program.file("map.pcd"));
  const std::size_t bytes = surfaces.size() * sizeof(liblocus::Surface);
  ASSERT_GT(surfaces.size(), 100U);
  ASSERT_LT(bytes, map.size());
  EXPECT_EQ(std::memcmp(map.data() + (map.size() - bytes), surfaces.data(), bytes), 0);
}

TEST(Library, InputByInputEqualsTheProgram) {
  liblocus::Odometry odometry(room_drive() / "config.yaml");
  const std::vector<Estimate> estimates = feed(odometry, room_drive());
  const Replay room = program(room_drive());
  expect_same(estimates, room);
  expect_same_map(odometry.map(), room);
}

TEST(Library, PlantEqualsTheProgram) {
  liblocus::Odometry odometry(plant_drive() / "config.yaml");
  expect_same(feed(odometry, plant_drive()), program(plant_drive()));
}

TEST(Library, ReplayEqualsTheProgram) {
  liblocus::Replay replay(room_drive());
  std::vector<Estimate> estimates;
  while (std::optional<Estimate> estimate = replay.next()) {
    EXPECT_GT(replay.scan().size(), 100U);
    estimates.push_back(*std::move(estimate));
  }
  const Replay room = program(room_drive());
  expect_same(estimates, room);
  expect_same_map(replay.map(), room);
  EXPECT_FALSE(replay.next());
}

TEST(Library, ReplayReadsAKittiDrive) { expect_same(replay(kitti_room_drive()), program(kitti_room_drive())); }

TEST(Library, ReplayOfAPartEqualsTheProgram) {
  using std::chrono::seconds;
  liblocus::Replay replay(room_drive(), {.overrides = {"threads=1"}, .start = seconds{3}, .duration = seconds{2}});
  std::vector<Estimate> estimates;
  while (std::optional<Estimate> estimate = replay.next())
    estimates.push_back(*std::move(estimate));
  expect_same(estimates, Replay({"--start", "3", "--duration", "2", room_drive()}));
}

/// Owns the arrays of a cloud.
struct Arrays {
  std::vector<float> xyz_m, intensity;
  std::vector<double> time_s;
  std::vector<std::uint16_t> ring;

  explicit Arrays(const OwnCloud& cloud) {
    for (std::size_t i = 0; i < cloud.width; ++i) {
      for (const char* const name : {"x", "y", "z"})
        xyz_m.push_back(cloud.get<float>(i, name));
      intensity.push_back(cloud.get<float>(i, "intensity"));
      time_s.push_back(static_cast<double>(cloud.get<float>(i, "time")));
      ring.push_back(cloud.get<std::uint16_t>(i, "ring"));
    }
  }
};

/// Returns the clouds of the drive around the room without the initial standstill.
std::vector<OwnCloud> room_clouds() {
  constexpr std::size_t kStands = 35 * 76; // packets of the first three seconds
  std::vector<OwnCloud> clouds;
  for (const CloudTurn& turn : turns_of(room_drive() / "lidar.pcap", kStands))
    clouds.push_back(cloud_of(turn, CloudKind::velodyne_start));
  return clouds;
}

TEST(Library, CloudByCloudEqualsTheProgram) {
  const TemporaryFolder folder;
  const std::vector<OwnCloud> clouds = room_clouds();
  for (const OwnCloud& cloud : clouds)
    write_with_folders(folder / fmt::format("lidar0/data/{}.pcd", to_ns(cloud.stamp)), pcd_as_binary(cloud));
  const Duration step = clouds[1].stamp - clouds[0].stamp;
  liblocus::Odometry odometry({}, {"lidars.front.topic=/sweeps", kNoSources.front()});
  std::vector<Estimate> estimates;
  const auto keep = [&](std::vector<Estimate> more) { std::ranges::move(more, std::back_inserter(estimates)); };
  for (const OwnCloud& cloud : clouds) {
    const Arrays arrays(cloud);
    keep(odometry.cloud("front", {.stamp_ns = to_ns(cloud.stamp),
                                  .arrival_ns = to_ns(cloud.stamp + step),
                                  .xyz_m = arrays.xyz_m,
                                  .time_s = arrays.time_s,
                                  .ring = arrays.ring,
                                  .intensity = arrays.intensity}));
  }
  keep(odometry.finish());
  expect_same(estimates, program(folder.path(), kNoSources));
}

/// Feeds modified datagrams of the drive around the room to both.
void expect_same_of(const std::function<void(std::vector<FedDatagram>&)>& change) {
  std::vector<FedDatagram> datagrams = datagrams_of({room_drive() / "lidar.pcap"});
  change(datagrams);
  const TemporaryFolder folder;
  write_pcap(datagrams, folder / "changed.pcap");
  liblocus::Odometry odometry({}, kNoSources);
  expect_same(feed(odometry, datagrams), program(folder / "changed.pcap", kNoSources));
}

TEST(Library, DisorderedDuplicateAndTruncatedPacketsEqualTheProgram) {
  expect_same_of([](std::vector<FedDatagram>& datagrams) {
    for (std::size_t i = 1; i + 1 < datagrams.size(); i += 7)
      std::swap(datagrams[i].payload, datagrams[i + 1].payload);
    for (std::size_t i = 3; i + 1 < datagrams.size(); i += 11)
      datagrams[i].payload = datagrams[i - 1].payload;
    for (std::size_t i = 5; i < datagrams.size(); i += 13)
      datagrams[i].payload.resize(i % datagrams[i].payload.size());
    for (std::size_t i = 8; i < datagrams.size(); i += 17)
      std::ranges::fill(datagrams[i].payload, std::byte{0xFF});
  });
}

std::vector<FedDatagram> room_with_clock_set_by(Duration step) {
  std::vector<FedDatagram> datagrams = datagrams_of({room_drive() / "lidar.pcap"});
  for (std::size_t i = datagrams.size() / 2; i < datagrams.size(); ++i)
    datagrams[i].arrival += step;
  return datagrams;
}

TEST(Library, ReplayAfterAClockStepEqualsTheProgram) {
  using std::chrono::hours, std::chrono::milliseconds, std::chrono::seconds;
  for (const Duration step : {Duration{hours{1}}, Duration{seconds{-2}}, Duration{milliseconds{-30}}}) {
    const TemporaryFolder folder;
    write_pcap(room_with_clock_set_by(step), folder / "set.pcap");
    expect_same(replay(folder / "set.pcap"), program(folder / "set.pcap"));
  }
}

/// The program removes the step, which shows in the packets that follow; the library is fed one input at a time.
TEST(Library, ContinuesAfterAClockStep) {
  using std::chrono::hours, std::chrono::milliseconds, std::chrono::seconds;
  liblocus::Odometry sound({}, kNoSources);
  const std::size_t sweeps = feed(sound, room_with_clock_set_by({})).size();
  EXPECT_GT(sweeps, 70U);
  for (const Duration step :
       {Duration{hours{1}}, Duration{-hours{1}}, Duration{seconds{-2}}, Duration{milliseconds{-30}}}) {
    liblocus::Odometry set({}, kNoSources);
    const std::size_t after = feed(set, room_with_clock_set_by(step)).size();
    EXPECT_GT(after, sweeps - 25) << to_seconds(step);
    EXPECT_LT(after, sweeps + 10) << to_seconds(step);
  }
}

TEST(Library, ObjectsInTwoThreadsAreIndependent) {
  std::array<std::vector<Estimate>, 2> estimates;
  std::vector<std::thread> threads;
  threads.reserve(estimates.size());
  for (std::vector<Estimate>& each : estimates)
    threads.emplace_back([&each] { each = replay(room_drive()); });
  for (std::thread& thread : threads)
    thread.join();
  const Replay room = program(room_drive());
  for (const std::vector<Estimate>& each : estimates)
    expect_same(each, room);
}

class RealCaptureInLibrary : public testing::TestWithParam<const char*> {};

TEST_P(RealCaptureInLibrary, EqualsTheProgram) {
  const path capture = test_data() / "velodyne" / GetParam();
  if (!std::filesystem::exists(capture))
    GTEST_SKIP() << "no real captures in " << test_data() << "; set LOCUS_TEST_DATA";
  const Replay real = program(capture);
  expect_same(replay(capture), real);
  liblocus::Odometry odometry;
  expect_same(feed(odometry, datagrams_of({capture})), real);
}
INSTANTIATE_TEST_SUITE_P(Of, RealCaptureInLibrary,
                         testing::Values("hdl32e_moving_15mps.pcap", "vlp16_static_1200rpm_product21.pcap"));

TEST(Library, ReplayReadsABag) {
  const path bag = test_data() / "hesai/xt32";
  if (!std::filesystem::exists(bag))
    GTEST_SKIP() << "no real bags in " << test_data() << "; set LOCUS_TEST_DATA";
  expect_same(replay(bag), program(bag));
}

} // namespace
} // namespace locus::test
