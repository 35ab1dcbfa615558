// SPDX-License-Identifier: Apache-2.0
// locus-play --clock: a recording played to a node with use_sim_time.
#include <algorithm>
#include <chrono>
#include <filesystem>
#include <optional>
#include <sstream>
#include <thread>

#include "drivers/files/capture.hpp"
#include "drivers/files/pcap_writer.hpp"
#include "service/robot_network.hpp"

namespace locus::test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

/// A line of the peer that begins with a stamp.
struct HeardStamp {
  Stamp stamp, heard;
};

Stamp stamp_in(std::istringstream& row) {
  std::int64_t sec = 0, nanosec = 0;
  char dot = 0;
  row >> sec >> dot >> nanosec;
  return stamp_from_ns(sec * 1'000'000'000 + nanosec);
}

std::vector<HeardStamp> stamps_of(const Child& peer, const std::string& topic) {
  std::vector<HeardStamp> all;
  for (const std::string& line : peer.lines_of(topic)) {
    std::istringstream row(line);
    const Stamp stamp = stamp_in(row);
    std::int64_t heard_ns = 0;
    row >> heard_ns;
    all.push_back({stamp, stamp_from_ns(heard_ns)});
  }
  return all;
}

void expect_never_back(const std::vector<HeardStamp>& clock) {
  ASSERT_GT(clock.size(), 10U);
  for (std::size_t i = 1; i < clock.size(); ++i)
    EXPECT_GT(clock[i].stamp, clock[i - 1].stamp);
}

/// Expects /clock at a hundred messages a second, at this speed and never backwards, whatever its origin.
void expect_clock_goes(const std::vector<HeardStamp>& clock, double speed) {
  expect_never_back(clock);
  const double heard_s = to_seconds(clock.back().heard - clock.front().heard);
  EXPECT_NEAR(to_seconds(clock.back().stamp - clock.front().stamp) / heard_s, speed, 0.05 * speed);
  EXPECT_LT(static_cast<double>(clock.size()), 100 * heard_s + 2);
  EXPECT_GT(static_cast<double>(clock.size()), 70 * heard_s) << "a busy machine sleeps longer than it is told to";
}

/// Returns by how much stamps are ahead of the clock as their subscriber has it (99th percentile).
double ahead_s(const std::vector<HeardStamp>& heard, const std::vector<HeardStamp>& clock) {
  std::vector<double> all;
  for (const HeardStamp& one : heard) {
    const auto later = std::ranges::upper_bound(clock, one.heard, {}, &HeardStamp::heard);
    if (later != clock.begin())
      all.push_back(to_seconds(one.stamp - std::prev(later)->stamp));
  }
  EXPECT_GT(all.size(), 100U);
  std::ranges::sort(all);
  return all.empty() ? 0 : all[all.size() * 99 / 100];
}

class SimTime : public RobotNetwork {
 protected:
  /// Plays a recording once the peer has subscribed.
  static void play(const Child& peer, std::vector<std::string> options) {
    ASSERT_TRUE(peer.wait_for_line("listens"));
    options.insert(options.begin(), LOCUS_PLAY);
    Child play(std::move(options));
    ASSERT_EQ(play.wait_for_exit(), 0) << testing::PrintToString(play.lines());
    std::this_thread::sleep_for(milliseconds{500}); // the last messages are still in transit
  }

  struct Range {
    Stamp first = Stamp::max(), last;
  };
  static Range range_of_the_drive() {
    auto recording = Capture::open(capture() / "lidar.pcap");
    EXPECT_TRUE(recording);
    Range range;
    while (const Datagram* const datagram = recording ? recording->next() : nullptr)
      range = {std::min(range.first, datagram->receive_stamp), datagram->receive_stamp};
    return range;
  }
};

TEST_F(SimTime, ClockAtTwiceTheSpeedEqualsSensorsAndOdometry) {
  constexpr double kSpeed = 2.0, kStep_s = kSpeed * 0.01;
  const Child daemon(locusd(lidar_with("time: sensor")));
  const Child peer({FAST_DDS_PEER, "0", "listen", "/locus"});
  ASSERT_TRUE(hears_the_service(peer));
  play(peer, {"--clock", "--speed", "2", capture().string()});

  const std::vector<HeardStamp> clock = stamps_of(peer, "clock"), imu = stamps_of(peer, "imu");
  expect_clock_goes(clock, kSpeed);
  EXPECT_LT(ahead_s(imu, clock), 2 * kStep_s);
  std::vector<HeardStamp> odometry;
  for (const HeardPose& pose : heard(peer))
    odometry.push_back({pose.stamp, pose.heard});
  EXPECT_LT(ahead_s(odometry, clock), 2 * kStep_s);
  for (const HeardStamp& one : odometry)
    EXPECT_TRUE(clock.front().stamp < one.stamp && one.stamp < clock.back().stamp) << "of the same time";
}

TEST_F(SimTime, KeptStampsStayWithinTheRecording) {
  const auto [first, last] = range_of_the_drive();
  const Child peer({FAST_DDS_PEER, "0", "listen", "/locus"});
  play(peer, {"--clock", "--keep-stamps", "--speed", "4", capture().string()});
  const std::vector<HeardStamp> clock = stamps_of(peer, "clock");
  expect_never_back(clock);
  ASSERT_FALSE(clock.empty());
  EXPECT_LE(clock.back().stamp, last);
  EXPECT_GE(clock.front().stamp, first - seconds{1}) << "motion is played from a second ahead of the first datagram";
  EXPECT_FALSE(stamps_of(peer, "imu").empty());
}

TEST_F(SimTime, ClockWithKeptStampsEqualsTheRecording) {
  const auto [first, last] = range_of_the_drive();
  const Child peer({FAST_DDS_PEER, "0", "listen", "/locus"});
  play(peer, {"--clock", "--keep-stamps", "--speed", "4", capture().string()});
  const std::vector<HeardStamp> clock = stamps_of(peer, "clock"), imu = stamps_of(peer, "imu");
  expect_clock_goes(clock, 4.0);
  EXPECT_LT(ahead_s(imu, clock), 2 * 4.0 * 0.01);
  ASSERT_FALSE(clock.empty() || imu.empty());
  EXPECT_GT(clock.back().stamp, last - milliseconds{200});
  EXPECT_LT(clock.front().stamp, first + seconds{1});
}

/// The second half of a capture, followed by the first.
TEST_F(SimTime, ClockDoesNotFollowARecordingBackwards) {
  constexpr Duration kHalf = seconds{10};
  std::filesystem::create_directory(file("turned"));
  {
    auto writer = PcapWriter::open(file("turned/lidar.pcap"));
    ASSERT_TRUE(writer);
    for (const bool second_half : {true, false}) {
      auto recording = Capture::open(capture() / "lidar.pcap");
      ASSERT_TRUE(recording);
      std::optional<Stamp> first;
      while (const Datagram* const datagram = recording->next())
        if (first = first.value_or(datagram->receive_stamp); (datagram->receive_stamp - *first > kHalf) == second_half)
          writer->write(*datagram);
    }
  }
  const Child peer({FAST_DDS_PEER, "0", "listen", "/locus"});
  play(peer, {"--clock", "--keep-stamps", "--speed", "4", file("turned").string()});
  expect_never_back(stamps_of(peer, "clock"));
}

TEST_F(SimTime, ClockIsPublishedOnlyOnRequest) {
  const Child peer({FAST_DDS_PEER, "0", "listen", "/locus"});
  ASSERT_TRUE(peer.wait_for_line("listens"));
  const Child play(endlessly(capture()));
  EXPECT_TRUE(peer.wait_until([](const auto& lines) {
    return std::ranges::count_if(lines, [](const std::string& line) { return line.starts_with("imu "); }) > 50;
  }));
  EXPECT_TRUE(peer.lines_of("clock").empty());
}

} // namespace
} // namespace locus::test
