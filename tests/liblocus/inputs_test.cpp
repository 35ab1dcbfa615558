// SPDX-License-Identifier: Apache-2.0
// Invalid inputs: each causes a helpful error or a count, never a crash.
#include <cmath>
#include <functional>
#include <limits>
#include <random>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "fed_recording.hpp"
#include "liblocus.hpp"
#include "support/temporary_folder.hpp"
#include "support/test_drives.hpp"

namespace locus::test {
namespace {

using liblocus::Estimate;
using liblocus::Odometry;

constexpr std::int64_t kNow_ns = 1'700'000'000'000'000'000;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// Expects an error whose text has all of these parts.
void expect_error(const std::function<void()>& call, const std::vector<std::string>& parts) {
  try {
    call();
    ADD_FAILURE() << "no error, which should have said: " << parts.front();
  } catch (const liblocus::Error& error) {
    for (const std::string& part : parts)
      EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << "no '" << part << "' in: " << error.what();
  }
}

nlohmann::json figures(const Odometry& odometry) { return nlohmann::json::parse(odometry.figures_json()); }

liblocus::ImuSample imu_at(std::int64_t ns) { return {.stamp_ns = ns, .arrival_ns = ns}; }
liblocus::OdometrySample pose_at(std::int64_t ns) { return {.stamp_ns = ns, .arrival_ns = ns}; }

TEST(LibraryInputs, InvalidConfigurationIsAnErrorWithALinePerMistake) {
  expect_error([] { Odometry("/nowhere/robot.yaml"); }, {"/nowhere/robot.yaml", "cannot be read"});
  expect_error([] { Odometry({}, {"lidars.front.prot=1", "threads=0"}); }, {"prot", "port", "\n", "threads"});
  expect_error([] { liblocus::Replay("/nowhere"); }, {"/nowhere"});
  expect_error([] { liblocus::Replay(room_drive(), {.start = std::chrono::seconds{-1}}); }, {"start"});
  expect_error([] { liblocus::Replay(room_drive(), {.duration = std::chrono::hours{2'000'000}}); }, {"duration"});
}

TEST(LibraryInputs, RecordingWithoutPacketsIsAnErrorAtItsEnd) {
  const TemporaryFolder folder;
  write_pcap({}, folder / "empty.pcap");
  liblocus::Replay replay(folder / "empty.pcap");
  expect_error([&] { replay.next(); }, {"empty.pcap", "no valid data packet"});
  EXPECT_FALSE(replay.next());
}

TEST(LibraryInputs, SourceMustBeConfiguredAndOfThatKind) {
  Odometry odometry;
  expect_error([&] { odometry.imu("gyro", imu_at(kNow_ns)); }, {"gyro", "wio", "imu"});
  expect_error([&] { odometry.imu("wio", imu_at(kNow_ns)); }, {"wio", "odometry()"});
  expect_error([&] { odometry.odometry("imu", pose_at(kNow_ns)); }, {"imu", "imu()"});
  expect_error([&] { odometry.cloud("rear", {}); }, {"rear", "front"});
  expect_error([&] { odometry.cloud("front", {}); }, {"front", "packets", "topic"});
}

TEST(LibraryInputs, StampsOutsideTheValidRangeAreErrors) {
  Odometry odometry;
  for (const std::int64_t ns : {std::numeric_limits<std::int64_t>::min(), std::numeric_limits<std::int64_t>::max()}) {
    expect_error([&] { odometry.packet({}, ns); }, {"arrival_ns", "1951"});
    expect_error([&] { odometry.imu("imu", {.stamp_ns = ns, .arrival_ns = kNow_ns}); }, {"stamp_ns"});
    expect_error([&] { odometry.odometry("wio", {.stamp_ns = kNow_ns, .arrival_ns = ns}); }, {"arrival_ns"});
  }
}

TEST(LibraryInputs, CloudWithArraysOfDifferentLengthsIsAnError) {
  Odometry odometry({}, {"lidars.front.topic=/points"});
  const std::array<float, 6> two{1, 2, 3, 4, 5, 6};
  const std::array<double, 3> three{};
  const std::array<std::uint16_t, 1> one{};
  const auto cloud = [&](std::span<const float> xyz) {
    return liblocus::Cloud{.stamp_ns = kNow_ns, .arrival_ns = kNow_ns, .xyz_m = xyz};
  };
  expect_error([&] { odometry.cloud("front", cloud(std::span(two).first(5))); }, {"xyz_m", "5"});
  liblocus::Cloud times = cloud(two), rings = cloud(two), intensities = cloud(two);
  times.time_s = three;
  rings.ring = one;
  intensities.intensity = std::span(two).first(1);
  expect_error([&] { odometry.cloud("front", times); }, {"time_s", "3", "2 points"});
  expect_error([&] { odometry.cloud("front", rings); }, {"ring"});
  expect_error([&] { odometry.cloud("front", intensities); }, {"intensity"});
  EXPECT_EQ(figures(odometry)["lidars"]["front"]["clouds"]["received"], 0);
}

TEST(LibraryInputs, EmptyNaNAndOversizedCloudsAreCounted) {
  Odometry odometry({}, {"lidars.front.topic=/points"});
  const std::vector<float> nan(300, std::numeric_limits<float>::quiet_NaN());
  const std::vector<float> most(3 * ((std::size_t{1} << 20U) + 1));
  std::int64_t ns = kNow_ns;
  for (const std::span<const float> xyz : {std::span<const float>{}, std::span(nan), std::span(most)}) {
    ns += 100'000'000;
    for (const Estimate& estimate : odometry.cloud("front", {.stamp_ns = ns, .arrival_ns = ns + 1, .xyz_m = xyz}))
      EXPECT_EQ(estimate.points, 0U); // an empty cloud is that of a lidar without returns
  }
  const nlohmann::json clouds = figures(odometry)["lidars"]["front"]["clouds"];
  EXPECT_EQ(clouds["received"], 3);
  EXPECT_EQ(clouds["refused"]["too_large"], 1) << clouds;
}

TEST(LibraryInputs, InvalidPointTimesAreHarmless) {
  std::mt19937 dice(1); // NOLINT(cert-msc51-cpp): the same each time
  Odometry odometry({}, {"lidars.front.topic=/points"});
  std::vector<float> xyz(3 * 1000);
  std::vector<double> times(1000);
  for (int turn = 0; turn < 20; ++turn) {
    for (float& metres : xyz)
      metres = std::uniform_real_distribution<float>(-20, 20)(dice);
    for (double& time : times)
      time = turn % 4 == 0 ? kNaN : std::pow(10.0, std::uniform_real_distribution<double>(-300, 300)(dice));
    const std::int64_t ns = kNow_ns + turn * 100'000'000;
    odometry.cloud("front", {.stamp_ns = ns, .arrival_ns = ns, .xyz_m = xyz, .time_s = times});
  }
  odometry.finish();
  EXPECT_EQ(figures(odometry)["lidars"]["front"]["clouds"]["received"], 20);
}

TEST(LibraryInputs, ForeignPacketsAreCounted) {
  std::mt19937 dice(1); // NOLINT(cert-msc51-cpp): the same each time
  Odometry odometry;
  std::size_t packets = 0;
  for (const std::size_t bytes : {0U, 1U, 512U, 1205U, 1206U, 1207U, 65'507U, 200'000U}) {
    std::vector<std::byte> payload(bytes);
    for (std::byte& byte : payload)
      byte = static_cast<std::byte>(dice());
    odometry.packet(payload, kNow_ns + static_cast<std::int64_t>(++packets));
    odometry.packet(payload, kNow_ns + static_cast<std::int64_t>(packets), 7000);
  }
  const nlohmann::json total = figures(odometry)["packets"]["total"];
  EXPECT_EQ(total["received"], 2 * packets) << total;
  EXPECT_EQ(total["data"], 0) << total;
}

TEST(LibraryInputs, NonFiniteMotionIsCountedAndInvalidRotationIsAnError) {
  Odometry odometry;
  odometry.imu("imu", {.stamp_ns = kNow_ns, .arrival_ns = kNow_ns, .angular_velocity_radps = {kNaN, 0, 0}});
  odometry.odometry("wio", {.stamp_ns = kNow_ns, .arrival_ns = kNow_ns, .position_m = {kNaN, 0, 0}});
  odometry.odometry("wio", {.stamp_ns = kNow_ns, .arrival_ns = kNow_ns, .orientation_xyzw = {kNaN, 0, 0, 1}});
  const nlohmann::json sources = figures(odometry)["sources"];
  EXPECT_EQ(sources["imu"]["rejected"]["nan"], 1) << sources;
  EXPECT_EQ(sources["wio"]["rejected"]["nan"], 2) << sources;
  expect_error([&] { odometry.odometry("wio", {.orientation_xyzw = {0, 0, 0, 0}}); }, {"orientation_xyzw", "unit"});
  liblocus::ImuSample sample = imu_at(kNow_ns);
  sample.orientation_xyzw = {1, 1, 1, 1};
  expect_error([&] { odometry.imu("imu", sample); }, {"orientation_xyzw"});
}

TEST(LibraryInputs, InputAfterTheEndIsAnError) {
  Odometry odometry;
  EXPECT_TRUE(odometry.finish().empty());
  expect_error([&] { odometry.packet({}, kNow_ns); }, {"finish()"});
  expect_error([&] { odometry.finish(); }, {"finish()"});
}

TEST(LibraryInputs, ErrorLeavesTheStateUnchanged) {
  const std::vector<FedDatagram> datagrams = datagrams_of({room_drive() / "lidar.pcap"});
  Odometry sound({}, {"motion_sources=[]"}), disturbed({}, {"motion_sources=[]"});
  for (const FedDatagram& datagram : datagrams) {
    EXPECT_THROW(disturbed.imu("none", {}), liblocus::Error);
    const auto expected = sound.packet(datagram.payload, to_ns(datagram.arrival));
    const auto estimates = disturbed.packet(datagram.payload, to_ns(datagram.arrival));
    ASSERT_EQ(estimates.size(), expected.size());
    for (std::size_t i = 0; i < estimates.size(); ++i)
      ASSERT_EQ(estimates[i].position_m, expected[i].position_m);
  }
}

TEST(LibraryInputs, AddressesAreReadFromText) {
  EXPECT_EQ(liblocus::parse_ip("192.168.1.201"), 0xC0A801C9U);
  for (const char* const text : {"", "lidar", "192.168.1", "1.2.3.4.5", "::1"})
    expect_error([&] { liblocus::parse_ip(text); }, {text, "192.168.1.201"});
}

} // namespace
} // namespace locus::test
