// SPDX-License-Identifier: Apache-2.0
// Sensors, drivers and recorders as users have met them, on a robot in a plant, one in a mine and one that walks.
#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <optional>
#include <ostream>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "bag_writer.hpp"
#include "drivers/files/capture.hpp"
#include "drivers/files/pcap_writer.hpp"
#include "drivers/velodyne/model.hpp"
#include "drivers/wire.hpp"
#include "replay_run.hpp"
#include "support/pcapng_file.hpp"
#include "support/test_drives.hpp"

namespace locus::test {
namespace {

using std::chrono::seconds;

struct Drive {
  std::string name;
  std::filesystem::path folder;
  std::string odometry;               ///< the one that is used
  std::vector<std::string> arguments; ///< of each replay

  friend void PrintTo(const Drive& drive, std::ostream* out) { *out << drive.name; }
};

void add(std::vector<std::string>& arguments, const std::vector<std::string>& more) {
  arguments.insert(arguments.end(), more.begin(), more.end());
}

/// A drive, of which a case changes some files.
class CaptureFolder {
 public:
  using Send = std::function<void(Stamp, const Bytes&)>;

  explicit CaptureFolder(const Drive& drive) : drive_(drive) {
    for (const auto& entry : std::filesystem::directory_iterator(drive.folder))
      if (const std::filesystem::path name = entry.path().filename(); name != "gt_map.ply")
        std::filesystem::create_symlink(entry.path(), folder_ / name);
  }

  [[nodiscard]] Replay replay(std::vector<std::string> arguments = {}) const {
    add(arguments, drive_.arguments);
    arguments.push_back(folder_.path());
    return Replay(std::move(arguments));
  }

  /// Makes a file anew.
  [[nodiscard]] std::ofstream file(const std::string& name) const {
    std::filesystem::remove(folder_ / name);
    return std::ofstream(folder_ / name, std::ios::binary);
  }

  /// Passes each packet with its time of reception to `change`, which sends any number of packets in its place.
  void change_packets(const std::function<void(Stamp, const Bytes&, const Send&)>& change) const {
    std::filesystem::remove(folder_ / "lidar.pcap");
    auto capture = Capture::open(drive_.folder / "lidar.pcap");
    auto writer = PcapWriter::open(folder_ / "lidar.pcap");
    while (const Datagram* datagram = capture->next()) {
      const UdpAddresses addresses{.source_ip = datagram->source_ip, .destination_port = datagram->destination_port};
      change(datagram->receive_stamp, {datagram->payload.begin(), datagram->payload.end()},
             [&](Stamp stamp, const Bytes& payload) { writer->write(stamp, addresses, payload); });
    }
  }

  /// Passes each sample of the IMU, and its number, to `change`.
  void change_imu(const std::function<void(std::size_t, ImuSample&)>& change) const {
    std::vector<ImuSample> samples = MotionSamples<ImuSample>::open(drive_.folder / "imu.csv")->drain();
    std::ofstream out = file("imu.csv");
    for (std::size_t i = 0; i < samples.size(); ++i) {
      change(i, samples[i]);
      out << to_line(samples[i]);
    }
  }

  /// Drops samples of the IMU down to a rate.
  void keep_imu_at(int hz) const {
    const std::vector<ImuSample> samples = MotionSamples<ImuSample>::open(drive_.folder / "imu.csv")->drain();
    std::ofstream out = file("imu.csv");
    Stamp next = samples.front().stamp;
    for (const ImuSample& sample : samples)
      if (sample.stamp >= next) {
        out << to_line(sample);
        next += Duration{seconds{1}} / hz;
      }
  }

  /// Sets the clock of the computer that recorded all files.
  void change_times(const std::function<Stamp(Stamp)>& change) const {
    change_packets([&](Stamp stamp, const Bytes& payload, const Send& send) { send(change(stamp), payload); });
    change_imu([&](std::size_t, ImuSample& sample) { sample.stamp = change(sample.stamp); });
    for (const std::string name : {"wio.tum", "vio.tum", "kio.tum", "gt.tum"}) {
      if (!std::filesystem::exists(drive_.folder / name))
        continue;
      std::ofstream out = file(name);
      for (StampedPose pose : read_tum(drive_.folder / name)) {
        pose.stamp = change(pose.stamp);
        out << to_line(pose);
      }
    }
  }

 private:
  const Drive& drive_;
  TemporaryFolder folder_;
};

/// Expects errors that exceed those of `reference` by at most a tenth and a millimetre.
void expect_no_worse(const Replay& replay, const Replay& reference) {
  ASSERT_EQ(replay.run().status, 0) << replay.run().err;
  EXPECT_EQ(replay.trajectory().size(), reference.trajectory().size());
  for (const char* const figure : {"mean", "max"})
    EXPECT_LE(replay.summary()["ape_m"][figure].get<double>(),
              1.1 * reference.summary()["ape_m"][figure].get<double>() + 0.001)
        << figure;
}

void expect_same(const Replay& replay, const Replay& reference) {
  ASSERT_EQ(replay.run().status, 0) << replay.run().err;
  EXPECT_EQ(read_text(replay.file("odometry.tum")), read_text(reference.file("odometry.tum")));
}

/// Expects one warning that contains `text`.
void expect_said(const Replay& replay, const std::string& text) {
  EXPECT_EQ(lines_of(replay.run().err).size(), 1U) << replay.run().err;
  EXPECT_NE(replay.run().err.find(text), std::string::npos) << "no '" << text << "' in: " << replay.run().err;
}

class FieldCases : public testing::TestWithParam<Drive> {
 protected:
  static const Drive& drive() { return GetParam(); }
  [[nodiscard]] static std::vector<std::string> without_odometry() { return {"--fail", drive().odometry + ":lost@0"}; }
};

/// A lidar whose microseconds continue beyond the hour, but for one packet that claims 48 s.
void expect_hour_to_cost_one_packet(const Drive& drive, const Replay& sound) {
  constexpr std::uint32_t kHour_us = 3'600'000'000, kBefore_us = 8'000'000, kLone_us = 48'000'000;
  const CaptureFolder changed(drive);
  std::optional<std::uint32_t> first_us;
  bool was_alone = false;
  changed.change_packets([&](Stamp stamp, Bytes packet, const CaptureFolder::Send& send) {
    if (packet.size() == velodyne::kDataPacketBytes) {
      const std::uint32_t us = read_u32(&packet[velodyne::kTimeOffset]);
      first_us = first_us.value_or(us);
      const std::uint32_t runs_on_us = kHour_us - kBefore_us + (us + kHour_us - *first_us) % kHour_us;
      const bool is_alone = runs_on_us >= kHour_us && !std::exchange(was_alone, runs_on_us >= kHour_us);
      put_little_endian(&packet[velodyne::kTimeOffset], is_alone ? kLone_us : runs_on_us, 4);
    }
    send(stamp, packet);
  });
  const Replay replay = changed.replay();
  expect_no_worse(replay, sound);
  EXPECT_EQ(replay.summary()["packets"]["total"]["rejected"]["time"], 1);
  EXPECT_EQ(replay.summary()["packets"]["total"]["lost"], 1);
}

void expect_host_clock_to_be_continued(const Drive& drive, const Replay& sound) {
  constexpr double kFarthest_m = 0.3; ///< in a sweep, by these robots
  const CaptureFolder changed(drive);
  const Stamp set_at = read_tum(drive.folder / "gt.tum").front().stamp + seconds{10};
  changed.change_times([&](Stamp stamp) { return stamp < set_at ? stamp : stamp + seconds{200'000'000}; });
  const Replay replay = changed.replay();
  expect_no_worse(replay, sound);
  expect_said(replay, "the clock of the recording computer was set");
  const std::vector<StampedPose> poses = replay.trajectory();
  for (std::size_t i = 1; i < poses.size(); ++i)
    EXPECT_LT((poses[i].T_source_base.translation - poses[i - 1].T_source_base.translation).norm(), kFarthest_m) << i;
}

/// A file of nanoseconds that claims microseconds.
void expect_nanoseconds_to_be_read_as_such(const Drive& drive, const Replay& sound) {
  constexpr std::uint32_t kMicroseconds = 0xA1B2C3D4;
  std::string bytes = read_text(drive.folder / "lidar.pcap");
  std::memcpy(bytes.data(), &kMicroseconds, sizeof(kMicroseconds));
  const CaptureFolder changed(drive);
  changed.file("lidar.pcap") << bytes;
  const Replay replay = changed.replay();
  expect_same(replay, sound);
  expect_said(replay, "nanoseconds");
}

/// A capture without times of reception; lidar alone, since it is in no common time with the other files.
void expect_lidar_clock_to_replace_times(const Drive& drive) {
  const TemporaryFolder folder;
  {
    auto capture = Capture::open(drive.folder / "lidar.pcap");
    auto writer = PcapWriter::open(folder / "lidar.pcap");
    while (const Datagram* datagram = capture->next())
      writer->write(Stamp{}, {.source_ip = datagram->source_ip, .destination_port = datagram->destination_port},
                    datagram->payload);
  }
  const auto lidar_alone = [&](const std::filesystem::path& file) {
    return Replay({"-c", drive.folder / "config.yaml", "--ground-truth", drive.folder / "gt.tum", "--set",
                   "motion_sources=[]", file});
  };
  const Replay replay = lidar_alone(folder / "lidar.pcap"), sound = lidar_alone(drive.folder / "lidar.pcap");
  ASSERT_EQ(replay.run().status, 0) << replay.run().err;
  expect_said(replay, "those of the lidar's own clock are used");
  for (const char* const figure : {"mean", "max"})
    EXPECT_NEAR(replay.summary()["ape_m"][figure], sound.summary()["ape_m"][figure], 0.001) << figure;
  const std::vector<StampedPose> poses = replay.trajectory(), expected = sound.trajectory();
  ASSERT_EQ(poses.size(), expected.size());
  for (std::size_t i = 0; i < poses.size(); ++i)
    EXPECT_NEAR(to_seconds(poses[i].stamp - expected[i].stamp), 0, 0.001) << i;
}

/// A capture of two interfaces that differ in link type and snap length; that of the lidar comes second.
void expect_interfaces_to_be_read(const Drive& drive, const Replay& sound) {
  PcapngFile file;
  file.add_interface(113, 262'144, 9); // cooked
  file.add_interface(1, 65'535, 9);    // Ethernet
  auto capture = Capture::open(drive.folder / "lidar.pcap");
  for (int i = 0; const Datagram* datagram = capture->next(); ++i) {
    const auto ns = static_cast<std::uint64_t>(to_ns(datagram->receive_stamp));
    if (i % 700 == 0)
      file.add_frame(0, ns, linux_cooked(ipv4_udp({.source_port = 5353, .destination_port = 5353}, Bytes(20))));
    file.add_frame(1, ns,
                   ethernet(ipv4_udp({.source_ip = datagram->source_ip, .destination_port = datagram->destination_port},
                                     datagram->payload)));
  }
  const CaptureFolder changed(drive);
  changed.file("lidar.pcap").write(reinterpret_cast<const char*>(file.bytes().data()), std::ssize(file.bytes()));
  const Replay replay = changed.replay();
  expect_same(replay, sound);
  EXPECT_EQ(replay.run().err, "");
}

TEST_P(FieldCases, ClocksAndFilesChangeNothing) {
  const Replay sound = CaptureFolder(drive()).replay();
  ASSERT_EQ(sound.run().err, "");
  expect_hour_to_cost_one_packet(drive(), sound);
  expect_host_clock_to_be_continued(drive(), sound);
  expect_nanoseconds_to_be_read_as_such(drive(), sound);
  expect_interfaces_to_be_read(drive(), sound);
  expect_lidar_clock_to_replace_times(drive());
}

/// A VLP-16 that is set to a field of view about azimuth 0: it sends the blocks in it, twelve to a packet, each packet
/// with the time of its first block.
class RestrictedView {
 public:
  explicit RestrictedView(int half_deg) : half_cdeg_(100 * half_deg) {}

  void add(Stamp stamp, const Bytes& packet, const CaptureFolder::Send& send) {
    constexpr double kBlock_us = 110.592;
    constexpr std::uint32_t kHour_us = 3'600'000'000;
    const auto at = [](const Bytes& bytes, std::size_t i) { return bytes.begin() + static_cast<std::ptrdiff_t>(i); };
    for (std::size_t block = 0; block < velodyne::kBlocks; ++block) {
      const std::size_t begin = block * velodyne::kBlockBytes;
      const int azimuth_cdeg = read_u16(&packet[begin + 2]);
      if (azimuth_cdeg >= half_cdeg_ && azimuth_cdeg < velodyne::kCdegPerTurn - half_cdeg_)
        continue;
      if (blocks_.empty())
        first_us_ = (read_u32(&packet[velodyne::kTimeOffset]) +
                     static_cast<std::uint32_t>(kBlock_us * static_cast<double>(block))) %
                    kHour_us;
      blocks_.insert(blocks_.end(), at(packet, begin), at(packet, begin + velodyne::kBlockBytes));
      if (blocks_.size() < velodyne::kBlocks * velodyne::kBlockBytes)
        continue;
      blocks_.insert(blocks_.end(), at(packet, blocks_.size()), packet.end());
      put_little_endian(&blocks_[velodyne::kTimeOffset], first_us_, 4);
      send(stamp, blocks_);
      blocks_.clear();
    }
  }

 private:
  int half_cdeg_;
  Bytes blocks_;
  std::uint32_t first_us_ = 0;
};

/// A lidar that is set to send some azimuths only. With half of them the error at most doubles, and a robot with wheels
/// or legs and a gyro is always better off with such a lidar than with none.
TEST_P(FieldCases, RestrictedViewsAreUsedAndNotLost) {
  constexpr double kBesideSources = 1.5, kHalfAView = 2.0, kWorst_sigma = 4.0, kTolerance_m = 0.001;
  const auto error_m = [](const Replay& replay, const char* figure) {
    return replay.summary()["ape_m"][figure].get<double>();
  };
  const CaptureFolder sound(drive());
  const Replay whole = sound.replay(), blind = sound.replay({"--fail", "all-lidars:lost@1"});
  for (const int half_deg : {90, 45, 39}) {
    SCOPED_TRACE(half_deg);
    const CaptureFolder changed(drive());
    changed.change_packets(
        [view = RestrictedView(half_deg)](Stamp stamp, const Bytes& packet, const CaptureFolder::Send& send) mutable {
          if (packet.size() != velodyne::kDataPacketBytes)
            send(stamp, packet);
          else
            view.add(stamp, packet, send);
        });
    const Replay replay = changed.replay(), lidar_and_imu = changed.replay(without_odometry());
    for (const Replay* const one : {&replay, &lidar_and_imu}) {
      ASSERT_EQ(one->run().status, 0) << one->run().err;
      EXPECT_EQ(one->summary()["packets"]["total"]["lost"], 0);
      EXPECT_LE(one->summary()["covariance"]["worst_sigma"].get<double>(), kWorst_sigma);
    }
    for (const char* const figure : {"mean", "max"}) {
      EXPECT_LE(error_m(replay, figure), kBesideSources * error_m(blind, figure)) << figure;
      EXPECT_LE(error_m(lidar_and_imu, figure), error_m(blind, figure)) << figure;
      if (half_deg == 90) {
        EXPECT_LE(error_m(replay, figure), kHalfAView * error_m(whole, figure) + kTolerance_m) << figure;
      }
    }
  }
}

/// Drivers that stamp a sample as the one before.
TEST_P(FieldCases, RepeatedStampsOfAnImuAreHarmless) {
  const CaptureFolder changed(drive());
  changed.change_imu([last = Stamp{}](std::size_t i, ImuSample& sample) mutable {
    sample.stamp = i > 0 && i % 4 == 0 ? last : sample.stamp;
    last = sample.stamp;
  });
  const Replay replay = changed.replay(without_odometry());
  expect_no_worse(replay, CaptureFolder(drive()).replay(without_odometry()));
  EXPECT_EQ(replay.run().err, "");
}

/// At these rates a gyro does not measure the motion within a sweep, however right each sample is.
TEST_P(FieldCases, SlowImuIsNotUsedAndNotBlamed) {
  std::vector<std::string> lidar_alone = without_odometry();
  add(lidar_alone, {"--fail", "imu:lost@0"});
  const Replay reference = CaptureFolder(drive()).replay(lidar_alone);
  for (const int hz : {20, 10}) {
    const CaptureFolder changed(drive());
    changed.keep_imu_at(hz);
    const Replay replay = changed.replay(without_odometry());
    expect_no_worse(replay, reference); // not the same: it tells the vertical
    expect_said(replay, "too low to measure the motion within a sweep");
    EXPECT_NE(replay.summary()["sources"]["imu"]["verdict"].get<std::string>().find("too low"), std::string::npos);
    EXPECT_EQ(replay.run().err.find("disagree"), std::string::npos) << replay.run().err;
  }
}

TEST_P(FieldCases, AccelerationsInGLeaveNoTrace) {
  const CaptureFolder changed(drive());
  changed.change_imu([](std::size_t, ImuSample& sample) { sample.specific_force_mps2 /= 9.80665; });
  const Replay replay = changed.replay(without_odometry());
  std::vector<std::string> gyro_alone = without_odometry();
  add(gyro_alone, {"--set", "motion_sources.imu.use_acceleration=off"});
  expect_same(replay, changed.replay(gyro_alone));
  expect_said(replay, "as if in g");
}

/// Drivers without an accelerometer that fill in gravity.
TEST_P(FieldCases, ConstantAccelerationsAreNotUsed) {
  const CaptureFolder changed(drive());
  changed.change_imu([](std::size_t, ImuSample& sample) { sample.specific_force_mps2 = {0, 0, 9.81}; });
  for (const std::vector<std::string>& arguments : {std::vector<std::string>{}, without_odometry()}) {
    std::vector<std::string> gyro_alone = arguments;
    add(gyro_alone, {"--set", "motion_sources.imu.use_acceleration=off"});
    const Replay replay = changed.replay(arguments);
    expect_no_worse(replay, changed.replay(gyro_alone));
    expect_said(replay, "repeats one acceleration while its turn rates change");
  }
}

/// Drivers that go on with empty messages when their unit is gone.
TEST_P(FieldCases, ImuThatSendsZerosIsLost) {
  constexpr std::size_t kGone = 1000;
  Stamp gone;
  const CaptureFolder changed(drive());
  changed.change_imu([&](std::size_t i, ImuSample& sample) {
    gone = i == kGone ? sample.stamp : gone;
    if (i >= kGone)
      sample.angular_velocity_radps = sample.specific_force_mps2 = Eigen::Vector3d::Zero();
  });
  const double gone_s = to_seconds(gone - read_tum(drive().folder / "gt.tum").front().stamp);
  for (const std::vector<std::string>& arguments : {std::vector<std::string>{}, without_odometry()}) {
    std::vector<std::string> silent = arguments;
    add(silent, {"--fail", "imu:lost@" + std::to_string(gone_s)});
    const Replay replay = changed.replay(arguments);
    expect_no_worse(replay, CaptureFolder(drive()).replay(silent));
    expect_said(replay, "motion source imu was rejected for");
    expect_said(replay, "repeats one reading");
  }
}

/// The drive as a bag whose drivers fill some messages otherwise.
class Bag {
 public:
  explicit Bag(const Drive& drive, decltype(scan_message)& scan = scan_message)
      : drive_(drive), messages_(messages_of(drive.folder, RosVersion::ros2, scan)) {}

  void add(const RecordedMessage& message) { messages_.push_back(message); }

  /// Passes the doubles of each message of the odometry to `change`, and the message's number.
  struct Doubles {
    std::array<double, 7> xyz_xyzw;
    std::array<double, 36> pose_covariance;
    std::array<double, 6> twist;
    std::array<double, 36> twist_covariance;
  };
  void change_odometry(const std::function<void(std::size_t, Doubles&)>& change) {
    for (std::size_t number = 0; RecordedMessage & message : messages_) {
      if (!message.topic.ends_with(drive_.odometry == "wio" ? "wheel_odometry" : "visual_odometry"))
        continue;
      Doubles doubles{};
      std::byte* const at = message.data.data() + message.data.size() - sizeof(doubles);
      std::memcpy(&doubles, at, sizeof(doubles));
      change(number++, doubles);
      std::memcpy(at, &doubles, sizeof(doubles));
    }
  }

  [[nodiscard]] Replay replay(std::vector<std::string> arguments = {}) {
    const TemporaryFolder folder;
    const std::string file = folder / "drive.db3";
    std::ranges::stable_sort(messages_, {}, &RecordedMessage::recorded);
    write_db3(file, messages_);
    test::add(arguments, drive_.arguments);
    test::add(arguments, {"-c", drive_.folder / "config.yaml", "--ground-truth", drive_.folder / "gt.tum", file});
    return Replay(std::move(arguments));
  }

 private:
  const Drive& drive_;
  std::vector<RecordedMessage> messages_;
};

std::vector<std::byte> scan_with_constant_stamps(std::span<const ReceivedPacket> packets, RosVersion ros) {
  std::vector<ReceivedPacket> stamped(packets.begin(), packets.end());
  for (ReceivedPacket& packet : stamped)
    packet.stamp = stamp_from_ns(904'636'608'000'032'663);
  return scan_message(stamped, ros);
}

/// Scan of a lidar that looks backwards.
std::vector<std::byte> scan_of_rear(std::span<const ReceivedPacket> packets, RosVersion ros) {
  constexpr std::uint32_t kTurn_cdeg = velodyne::kCdegPerTurn;
  std::vector<ReceivedPacket> turned(packets.begin(), packets.end());
  for (ReceivedPacket& packet : turned)
    for (std::size_t i = 0; i < velodyne::kBlocks; ++i) {
      std::byte* const azimuth = &packet.payload[i * velodyne::kBlockBytes + 2];
      put_little_endian(azimuth, (read_u16(azimuth) + kTurn_cdeg / 2) % kTurn_cdeg, 2);
    }
  std::vector<std::byte> message = scan_message(turned, ros);
  constexpr std::size_t kFrame = 16; ///< after encapsulation, stamp and length
  message[kFrame] = std::byte{'R'};
  return message;
}

TEST_P(FieldCases, ScansThatDriversFillWronglyAreUsed) {
  const Replay sound = Bag(drive()).replay();
  const Replay constant = Bag(drive(), scan_with_constant_stamps).replay();
  expect_no_worse(constant, sound);
  expect_said(constant, "the times at which the bag was recorded are used instead");

  Bag two(drive());
  for (RecordedMessage& message : messages_of(drive().folder, RosVersion::ros2, scan_of_rear)) {
    message.recorded += std::chrono::milliseconds{1};
    if (message.topic.ends_with("velodyne_packets"))
      two.add(message);
  }
  const Replay of_first = two.replay();
  expect_same(of_first, sound);
  expect_said(of_first, "several lidars publish on it: frame_id");
}

/// Variances that are huge, negative or zero are unknown, and the first messages are garbage.
TEST_P(FieldCases, OdometryOfUnknownVarianceIsUsed) {
  constexpr double kMax = std::numeric_limits<double>::max(), kNaN = std::numeric_limits<double>::quiet_NaN();
  Bag bag(drive());
  bag.change_odometry([&](std::size_t number, Bag::Doubles& message) {
    for (std::size_t i = 0; const double variance : {kMax, -1.0, 0.0, 1e12, 1e6, 2e-3})
      message.twist_covariance[7 * i++] = variance;
    constexpr std::array kGarbage{std::array{kNaN, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0},
                                  std::array{1e30, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0},
                                  std::array{0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0}};
    if (number < 10)
      message.xyz_xyzw = kGarbage[number % kGarbage.size()];
  });
  const Replay replay = bag.replay();
  expect_no_worse(replay, Bag(drive()).replay());
  EXPECT_EQ(replay.run().err, "");
}

TEST_P(FieldCases, OdometryWithoutPoseIsNotUsed) {
  const Replay without = Bag(drive()).replay(without_odometry());
  const auto expect_refused = [&](const std::function<void(Bag::Doubles&)>& change, const std::string& reason) {
    Bag bag(drive());
    bag.change_odometry([&](std::size_t, Bag::Doubles& message) { change(message); });
    const Replay replay = bag.replay();
    expect_no_worse(replay, without);
    expect_said(replay, "motion source " + drive().odometry + " was rejected for");
    expect_said(replay, reason);
  };
  expect_refused([](Bag::Doubles& message) { message.xyz_xyzw = {0, 0, 0, 0, 0, 0, 1}; }, "repeats");
  expect_refused([](Bag::Doubles& message) { message.xyz_xyzw[6] = 0; }, "orientations that are no rotation");
}

INSTANTIATE_TEST_SUITE_P(On, FieldCases,
                         testing::Values(Drive{"Plant", plant_drive(), "wio", {}},
                                         Drive{"Mine", mine_drive(), "wio", {}},
                                         Drive{"Walking", walking_drive(), "vio", {"--fail", "kio:lost@0"}}),
                         [](const auto& of) { return of.param.name; });

} // namespace
} // namespace locus::test
