// SPDX-License-Identifier: Apache-2.0
#include "faults/fault_injection.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <optional>
#include <set>
#include <utility>

#include <gtest/gtest.h>

#include "drivers/hesai/decoder.hpp"
#include "drivers/hesai_test_packet.hpp"
#include "drivers/ouster/decoder.hpp"
#include "drivers/ouster/imu_packet.hpp"
#include "drivers/ouster_test_packet.hpp"
#include "drivers/velodyne/model.hpp"
#include "drivers/velodyne/position_packet.hpp"
#include "drivers/wire.hpp"
#include "locus_sim/ouster_packet.hpp"

namespace locus {
namespace {

using namespace std::chrono_literals;

const Stamp kStart = stamp_from_ns(1'700'000'000'000'000'000);

std::vector<Fault> faults_of(std::initializer_list<std::string_view> texts) {
  std::vector<Fault> faults;
  for (const std::string_view text : texts) {
    const Expected<Fault, std::string> fault = Fault::parse(text);
    if (!fault) {
      throw std::invalid_argument(fault.error());
    }
    faults.push_back(*fault);
  }
  return faults;
}

/// Ten samples per second for two seconds, one metre apart.
std::vector<OdometrySample> drive() {
  std::vector<OdometrySample> samples;
  for (int i = 0; i < 20; ++i) {
    OdometrySample& sample = samples.emplace_back();
    sample.stamp = kStart + i * 100ms;
    sample.arrival = sample.stamp + 5ms;
    sample.T_source_base.translation.x() = i;
  }
  return samples;
}

std::vector<OdometrySample> drive_with(std::initializer_list<std::string_view> faults) {
  std::vector<OdometrySample> samples = drive();
  inject_faults(faults_of(faults), "wio", kStart, 1, samples);
  return samples;
}

double x_m(const OdometrySample& sample) { return sample.T_source_base.translation.x(); }

TEST(InjectFaults, LostSamplesAreAbsentOnlyDuringTheFault) {
  const std::vector<OdometrySample> samples = drive_with({"wio:lost@0.5-1"});
  ASSERT_EQ(samples.size(), 15u);
  EXPECT_EQ(x_m(samples[4]), 4.0);
  EXPECT_EQ(x_m(samples[5]), 10.0);
}

TEST(InjectFaults, OtherSourcesAreUnchanged) {
  const std::vector<OdometrySample> samples = drive_with({"vio:lost@0", "all-lidars:lost@0"});
  EXPECT_EQ(samples.size(), 20u);
}

TEST(InjectFaults, FrozenSourceRepeatsItsLastPoseWithNewStamps) {
  const std::vector<OdometrySample> samples = drive_with({"wio:frozen@0.5-1"});
  ASSERT_EQ(samples.size(), 20u);
  for (std::size_t i = 5; i < 10; ++i) {
    EXPECT_EQ(x_m(samples[i]), 4.0);
    EXPECT_EQ(samples[i].stamp, drive()[i].stamp);
  }
  EXPECT_EQ(x_m(samples[10]), 10.0);
}

TEST(InjectFaults, JumpOffsetsThePoseDuringTheFault) {
  const std::vector<OdometrySample> samples = drive_with({"wio:jump=-5@0.5-1"});
  EXPECT_EQ(x_m(samples[4]), 4.0);
  EXPECT_EQ(x_m(samples[5]), 0.0);
  EXPECT_EQ(x_m(samples[10]), 10.0);
}

TEST(InjectFaults, NanIsInEveryReading) {
  const std::vector<OdometrySample> samples = drive_with({"wio:nan@0"});
  EXPECT_TRUE(samples[0].T_source_base.translation.array().isNaN().all());
  EXPECT_TRUE(samples[0].T_source_base.rotation.coeffs().array().isNaN().all());

  std::vector<ImuSample> imu(1);
  imu[0].arrival = kStart;
  imu[0].attitude = Eigen::Quaterniond::Identity();
  inject_faults(faults_of({"imu:nan@0"}), "imu", kStart, 1, imu);
  EXPECT_TRUE(imu[0].angular_velocity_radps.array().isNaN().all());
  EXPECT_TRUE(imu[0].specific_force_mps2.array().isNaN().all());
  EXPECT_TRUE(imu[0].attitude->coeffs().array().isNaN().all());
}

TEST(InjectFaults, CorruptSamplesAreInvalidAndRetainTheirStamps) {
  const std::vector<OdometrySample> samples = drive_with({"wio:corrupt=100@0"});
  ASSERT_EQ(samples.size(), 20u);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    EXPECT_EQ(samples[i].stamp, drive()[i].stamp);
    const double norm = samples[i].T_source_base.rotation.coeffs().norm();
    EXPECT_FALSE(std::abs(norm - 1.0) < 1e-6) << norm;
  }
}

TEST(InjectFaults, JumpOfAnImuIsARotationAboutItsZ) {
  std::vector<ImuSample> imu(1);
  imu[0].arrival = kStart;
  inject_faults(faults_of({"imu:jump=0.5@0"}), "imu", kStart, 1, imu);
  EXPECT_EQ(imu[0].angular_velocity_radps, Eigen::Vector3d(0, 0, 0.5));
}

TEST(InjectFaults, LateSamplesRetainTheirStampAndArriveAfterPunctualOnes) {
  const std::vector<OdometrySample> samples = drive_with({"wio:late=0.25@0.5-0.6"}); // one sample: x = 5
  ASSERT_EQ(samples.size(), 20u);
  EXPECT_EQ(x_m(samples[5]), 6.0);
  EXPECT_EQ(x_m(samples[6]), 7.0);
  EXPECT_EQ(x_m(samples[7]), 5.0);
  EXPECT_EQ(samples[7].stamp, kStart + 500ms);
  EXPECT_EQ(samples[7].arrival, kStart + 755ms);
}

TEST(InjectFaults, CovarianceGrowsAndClockSteps) {
  const std::vector<OdometrySample> samples = drive_with({"wio:covariance=100@0.5", "wio:clock-step=3600@1"});
  EXPECT_EQ(samples[4].covariance_scale, 1.0);
  EXPECT_EQ(samples[5].covariance_scale, 100.0);
  EXPECT_EQ(samples[9].stamp, kStart + 900ms);
  EXPECT_EQ(samples[10].stamp, kStart + 1s + 1h);
  EXPECT_EQ(samples[10].arrival, kStart + 1005ms);
}

TEST(InjectFaults, ReorderedSamplesArriveRightAfterTheirSuccessor) {
  const std::vector<OdometrySample> samples = drive_with({"wio:reorder=100@0.5-0.6"}); // one sample: x = 5
  ASSERT_EQ(samples.size(), 20u);
  EXPECT_EQ(x_m(samples[5]), 6.0);
  EXPECT_EQ(x_m(samples[6]), 5.0);
  EXPECT_EQ(samples[6].arrival, samples[5].arrival);
  EXPECT_EQ(samples[6].stamp, kStart + 500ms);
}

TEST(InjectFaults, ReorderedLastSampleIsNotLost) { EXPECT_EQ(drive_with({"wio:reorder=100@1.9"}).size(), 20u); }

TEST(InjectFaults, DuplicatesArriveTwice) {
  const std::vector<OdometrySample> samples = drive_with({"wio:duplicate=100@0.5-0.6"});
  ASSERT_EQ(samples.size(), 21u);
  EXPECT_EQ(x_m(samples[5]), 5.0);
  EXPECT_EQ(x_m(samples[6]), 5.0);
  EXPECT_EQ(x_m(samples[7]), 6.0);
}

/// An emitted datagram and its number, which is its first byte.
struct Arrival {
  int number;
  Stamp receive_stamp;
  std::uint32_t time_of_hour_us;
  std::uint16_t port;

  bool operator==(const Arrival&) const = default;
};

std::uint32_t time_of_hour_us(const Datagram& datagram) {
  return read_u32(datagram.payload.data() + (datagram.payload.size() == velodyne::kDataPacketBytes
                                                 ? velodyne::kTimeOffset
                                                 : velodyne::kTimeOfHourOffset));
}

/// Twenty data packets of "front", one every 10 ms, each followed after 5 ms by a position packet, both with the
/// sensor's time since the start; then, with the same stamp as the latter, a data packet of "rear".
class Recording {
 public:
  explicit Recording(std::initializer_list<std::string_view> faults) {
    DatagramFaults injector{faults_of(faults), kStart, 1};
    const DatagramFaults::Emit emit = [&](const Datagram& datagram) {
      all.push_back({std::to_integer<int>(datagram.payload[0]), datagram.receive_stamp, time_of_hour_us(datagram),
                     datagram.destination_port});
    };
    for (int i = 0; i < 20; ++i) {
      send(injector, "front", i, 10ms * i, 2368, velodyne::kDataPacketBytes, velodyne::kTimeOffset, emit);
      send(injector, "front", i, 10ms * i + 5ms, 8308, velodyne::kPositionPacketBytes, velodyne::kTimeOfHourOffset,
           emit);
      send(injector, "rear", i, 10ms * i + 5ms, 2369, velodyne::kDataPacketBytes, velodyne::kTimeOffset, emit);
    }
    injector.finish(emit);
  }

  [[nodiscard]] std::vector<Arrival> to_port(std::uint16_t port) const {
    std::vector<Arrival> found;
    std::ranges::copy_if(all, std::back_inserter(found), [=](const Arrival& a) { return a.port == port; });
    return found;
  }
  [[nodiscard]] std::vector<int> numbers(std::uint16_t port) const {
    std::vector<int> found;
    std::ranges::transform(to_port(port), std::back_inserter(found), &Arrival::number);
    return found;
  }

  std::vector<Arrival> all;

 private:
  static void send(DatagramFaults& injector, std::string_view lidar, int number, Duration since_start,
                   std::uint16_t port, std::size_t size, std::size_t clock_offset, const DatagramFaults::Emit& emit) {
    std::vector<std::byte> payload(size);
    payload[0] = static_cast<std::byte>(number);
    const auto us = static_cast<std::uint32_t>(since_start / 1us);
    for (unsigned i = 0; i < 4; ++i) {
      payload[clock_offset + i] = static_cast<std::byte>(us >> 8 * i);
    }
    Datagram datagram;
    datagram.payload = payload;
    datagram.destination_port = port;
    datagram.receive_stamp = kStart + since_start;
    injector.pass({lidar}, datagram, emit);
  }
};

bool in_order_of_arrival(const Recording& recording) {
  return std::ranges::is_sorted(recording.all, {}, &Arrival::receive_stamp);
}

TEST(DatagramFaults, WithoutFaultsDatagramsAreUnchanged) {
  const Recording recording{};
  ASSERT_EQ(recording.all.size(), 60u);
  EXPECT_TRUE(in_order_of_arrival(recording));
  EXPECT_EQ(recording.all[3], (Arrival{1, kStart + 10ms, 10'000, 2368}));
}

TEST(DatagramFaults, LostLidarIsSilentAndOthersAreNot) {
  const Recording recording{"front:lost@0.05-0.1"};
  EXPECT_EQ(recording.to_port(2368).size(), 15u);
  EXPECT_EQ(recording.to_port(8308).size(), 15u);
  EXPECT_EQ(recording.to_port(2369).size(), 20u);
}

TEST(DatagramFaults, AllLidarsSelectsEachLidar) { EXPECT_TRUE(Recording{"all-lidars:lost@0"}.all.empty()); }

TEST(DatagramFaults, FrozenLidarRepeatsItsLastDataPacketWithNewReceiveStamps) {
  const Recording recording{"front:frozen@0.05-0.1"};
  const std::vector<Arrival> data = recording.to_port(2368);
  ASSERT_EQ(data.size(), 20u);
  for (int i = 5; i < 10; ++i) {
    EXPECT_EQ(data[static_cast<std::size_t>(i)], (Arrival{4, kStart + i * 10ms, 40'000, 2368}));
  }
  EXPECT_EQ(data[10].number, 10);
  EXPECT_EQ(recording.numbers(8308)[7], 4) << "and its last position packet";
}

TEST(DatagramFaults, PositionPacketsCanFailAlone) {
  const Recording recording{"front.position:frozen@0.05", "front.position:lost@0.1"};
  EXPECT_EQ(recording.numbers(2368), Recording{}.numbers(2368));
  EXPECT_EQ(recording.numbers(8308), (std::vector{0, 1, 2, 3, 4, 4, 4, 4, 4, 4}));
}

/// Returns the IMU samples of an Ouster named "top", ten per second for two seconds, with a yaw rate of the sample's
/// number in deg/s.
std::vector<ouster::ImuMeasurement> readings_with(std::initializer_list<std::string_view> faults) {
  DatagramFaults injector{faults_of(faults), kStart, 1};
  const ouster::Metadata metadata;
  std::vector<ouster::ImuMeasurement> readings;
  const auto keep = [&](const Datagram& datagram) {
    ouster::ImuMeasurements found;
    if (!ouster::read_imu_packet(metadata, datagram.payload, found))
      readings.push_back(found.storage.front());
  };
  for (int i = 0; i < 20; ++i) {
    const auto payload =
        sim::ouster_imu_packet(static_cast<std::uint64_t>(i) * 100'000'000, {0, 0, 1}, {0, 0, static_cast<float>(i)});
    injector.pass({"top", &metadata},
                  {.payload = payload, .destination_port = 7503, .receive_stamp = kStart + i * 100ms}, keep);
  }
  injector.finish(keep);
  return readings;
}

double rate_dps(const ouster::ImuMeasurement& reading) { return reading.angular_velocity_radps.z() / kRadPerDeg; }

TEST(DatagramFaults, ImuOfALidarFailsAloneOrWithItsLidar) {
  EXPECT_EQ(readings_with({"top_imu:lost@0.5-1"}).size(), 15U);
  EXPECT_EQ(readings_with({"top:lost@0.5-1"}).size(), 15U);
  EXPECT_EQ(readings_with({"top_imu:nan@0.5-1"}).size(), 15U); // non-finite samples are no readings
  EXPECT_NEAR(rate_dps(readings_with({"top_imu:frozen@0.5-1"})[7]), 4, 1e-4);
  EXPECT_NEAR(rate_dps(readings_with({"top_imu:jump=2@0.5-1"})[7]), 7 + 2 / kRadPerDeg, 1e-4);
  EXPECT_EQ(readings_with({"top_imu:clock-step=60@0.5-1"})[7].time, 60s + 700ms);
}

/// A jump in metres does not apply to a gyro, and the clock of the columns is separate.
TEST(DatagramFaults, JumpAndClockStepOfALidarDoNotAffectItsImu) {
  EXPECT_NEAR(rate_dps(readings_with({"top:jump=2@0.5-1"})[7]), 7, 1e-4);
  EXPECT_EQ(readings_with({"top:clock-step=60@0.5-1"})[7].time, 700ms);
}

/// A data packet of a VLP-16 with one return, in its last firing.
std::vector<std::byte> with_one_return(std::uint16_t raw_range) {
  std::vector<std::byte> payload(velodyne::kDataPacketBytes);
  payload[velodyne::kProductIdOffset] = std::byte{0x22};
  payload[velodyne::kTimeOffset - 3] = static_cast<std::byte>(raw_range);
  payload[velodyne::kTimeOffset - 2] = static_cast<std::byte>(raw_range >> 8);
  return payload;
}

std::vector<std::byte> after(std::initializer_list<std::string_view> faults, const std::vector<std::byte>& payload) {
  DatagramFaults injector{faults_of(faults), kStart, 1};
  Datagram datagram;
  datagram.payload = payload;
  datagram.receive_stamp = kStart;
  std::vector<std::byte> arrived;
  injector.pass({"front"}, datagram, [&](const Datagram& d) { arrived.assign(d.payload.begin(), d.payload.end()); });
  return arrived;
}

TEST(DatagramFaults, JumpLengthensOnlyRangesWithAReturn) {
  EXPECT_EQ(after({"front:jump=2@0"}, with_one_return(1000)), with_one_return(2000));
  EXPECT_EQ(after({"front:jump=-3@0"}, with_one_return(1000)), with_one_return(1)) << "and still is a return";
  EXPECT_EQ(after({"front:jump=1e6@0"}, with_one_return(1000)), with_one_return(65535));
  EXPECT_EQ(after({"front:jump=2@0"}, with_one_return(0)), with_one_return(0));
}

/// Its last block, with the return, is at this azimuth.
std::vector<std::byte> with_return_at(std::uint16_t azimuth_cdeg) {
  std::vector<std::byte> payload = with_one_return(1000);
  put_little_endian(&payload[velodyne::kTimeOffset - velodyne::kBlockBytes + 2], azimuth_cdeg, 2);
  return payload;
}

TEST(DatagramFaults, NarrowestViewHasNoReturnsOutside) {
  EXPECT_EQ(after({"front:view@0"}, with_return_at(8'900)), with_return_at(8'900)) << "180 degrees";
  EXPECT_EQ(after({"front:view=90@0"}, with_return_at(31'600)), with_return_at(31'600));
  std::vector<std::byte> blank = with_return_at(9'100);
  blank[velodyne::kTimeOffset - 3] = blank[velodyne::kTimeOffset - 2] = std::byte{0};
  EXPECT_EQ(after({"all-lidars:view@0"}, with_return_at(9'100)), blank);
  EXPECT_EQ(after({"front:view=90@0", "front:view=200@0"}, with_return_at(9'100)), blank);
  EXPECT_EQ(after({"front:view=360@0"}, with_return_at(18'000)), with_return_at(18'000));
}

/// Returns the shortest range and the time of an Ouster or Hesai packet after these faults, as decoded; nothing if the
/// decoder rejects it.
template <class Decoder>
std::optional<std::pair<float, Duration>> read_after(std::initializer_list<std::string_view> faults,
                                                     const ouster::Metadata* metadata, Decoder decoder,
                                                     std::span<const std::byte> payload) {
  DatagramFaults injector{faults_of(faults), kStart, 1};
  std::optional<std::pair<float, Duration>> found;
  injector.pass({"front", metadata}, {.payload = payload, .receive_stamp = kStart}, [&](const Datagram& datagram) {
    LidarPacket packet;
    if (decoder.decode(datagram.payload, packet))
      return;
    float shortest_m = std::numeric_limits<float>::max();
    for (const FiringGroup& group : packet.firing_groups())
      for (const float range_m : group.range_m)
        shortest_m = range_m > 0.0F ? std::min(shortest_m, range_m) : shortest_m;
    found = {shortest_m, decoder.time()};
  });
  return found;
}

TEST(DatagramFaults, JumpAndClockStepAffectLidarsOfEveryMaker) {
  const auto metadata = test::ouster_metadata();
  test::OusterTestPacket columns{metadata, 0, 5'000'000'000};
  columns.set_return(3, 7, 20'000);
  columns.seal();
  const auto ouster = [&](std::initializer_list<std::string_view> faults) {
    return read_after(faults, &metadata, ouster::Decoder{metadata}, columns.payload());
  };
  EXPECT_EQ(ouster({"front:jump=-2@0"}), std::pair(18.0F, Duration{5s}));
  EXPECT_EQ(ouster({"all-lidars:clock-step=60@0"}), std::pair(20.0F, Duration{65s}));

  test::HesaiTestPacket blocks{hesai::Model::qt128, 0x37};
  blocks.set_return(0, 7, 2'500);
  blocks.seal();
  const auto hesai = [&](std::initializer_list<std::string_view> faults) {
    return read_after(faults, nullptr, hesai::Decoder{}, blocks.payload());
  };
  const Duration time = hesai({})->second;
  EXPECT_EQ(hesai({"front:jump=-2@0"}), std::pair(8.0F, time));
  EXPECT_EQ(hesai({"front:clock-step=-90@0"}), std::pair(10.0F, time - 90s));
}

TEST(DatagramFaults, CorruptPacketsAreReproducible) {
  const std::vector<std::byte> healthy = with_one_return(1000);
  const std::vector<std::byte> corrupt = after({"front:corrupt=100@0"}, healthy);
  ASSERT_EQ(corrupt.size(), healthy.size());
  EXPECT_NE(corrupt, healthy);
  EXPECT_EQ(corrupt, after({"front:corrupt=100@0"}, healthy));
  EXPECT_EQ(after({"front:corrupt=100@0"}, {}), std::vector<std::byte>{});
}

TEST(DatagramFaults, LidarFrozenFromTheStartRepeatsItsFirstPacket) {
  const std::vector<int> numbers = Recording{"front:frozen@0"}.numbers(2368);
  EXPECT_EQ(numbers, std::vector<int>(20, 0));
}

TEST(DatagramFaults, LateDatagramsAreOrderedByTheirNewStamp) {
  const Recording recording{"front:late=0.032@0.05-0.055"}; // one data packet: 5
  EXPECT_TRUE(in_order_of_arrival(recording));
  EXPECT_EQ(recording.numbers(2368),
            (std::vector{0, 1, 2, 3, 4, 6, 7, 8, 5, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19}));
  EXPECT_EQ(recording.to_port(2368)[8], (Arrival{5, kStart + 82ms, 50'000, 2368}));
}

TEST(DatagramFaults, LateDatagramsStillArriveAfterTheEndOfTheCapture) {
  const Recording recording{"all-lidars:late=10@0"};
  EXPECT_EQ(recording.all.size(), 60u);
  EXPECT_TRUE(in_order_of_arrival(recording));
  EXPECT_EQ(recording.all.front().receive_stamp, kStart + 10s);
}

TEST(DatagramFaults, ClockStepShiftsAndWrapsTheTimeOfHourInBothKindsOfPacket) {
  const Recording ahead{"front:clock-step=60@0.05"};
  EXPECT_EQ(ahead.to_port(2368)[4].time_of_hour_us, 40'000u);
  EXPECT_EQ(ahead.to_port(2368)[5].time_of_hour_us, 60'050'000u);
  EXPECT_EQ(ahead.to_port(8308)[5].time_of_hour_us, 60'055'000u);
  EXPECT_EQ(ahead.to_port(2368)[5].receive_stamp, kStart + 50ms);
  EXPECT_EQ(ahead.to_port(2369)[5].time_of_hour_us, 55'000u);
  const Recording behind{"front:clock-step=-1@0.05"};
  EXPECT_EQ(behind.to_port(2368)[5].time_of_hour_us, 3'600'000'000u - 950'000u);
}

TEST(DatagramFaults, ReorderedDatagramFollowsItsSuccessorOfTheSameLidar) {
  const Recording recording{"rear:reorder=100@0.05-0.06"}; // one packet: 5
  EXPECT_TRUE(in_order_of_arrival(recording));
  const std::vector<Arrival> data = recording.to_port(2369);
  ASSERT_EQ(data.size(), 20u);
  EXPECT_EQ(data[5].number, 6);
  EXPECT_EQ(data[6], (Arrival{5, kStart + 65ms, 55'000, 2369}));
  EXPECT_EQ(recording.numbers(2368), Recording{}.numbers(2368));
}

TEST(DatagramFaults, ReorderingEverythingLosesNothing) {
  const Recording recording{"all-lidars:reorder=100@0"};
  EXPECT_EQ(recording.all.size(), 60u);
  EXPECT_TRUE(in_order_of_arrival(recording));
}

TEST(DatagramFaults, DuplicatesArriveTwiceAndLossesDoNot) {
  EXPECT_EQ(Recording{"rear:duplicate=100@0"}.all.size(), 80u);
  EXPECT_EQ(Recording{"rear:packet-loss=100@0"}.all.size(), 40u);
  const std::size_t half = Recording{"rear:packet-loss=50@0"}.to_port(2369).size();
  EXPECT_GT(half, 3u);
  EXPECT_LT(half, 17u);
}

TEST(DatagramFaults, SameFaultsGiveTheSameArrivalsOnEveryRun) {
  const auto faults = {std::string_view{"all-lidars:packet-loss=30@0"}, std::string_view{"rear:reorder=40@0"},
                       std::string_view{"front:duplicate=50@0.1"}, std::string_view{"front:late=0.02@0.05-0.1"}};
  EXPECT_EQ(Recording{faults}.all, Recording{faults}.all);
}

TEST(DatagramFaults, UnknownDatagramsPassUnchanged) {
  DatagramFaults injector{faults_of({"all-lidars:lost@0"}), kStart, 1};
  int emitted = 0;
  Datagram foreign;
  foreign.receive_stamp = kStart;
  injector.pass({}, foreign, [&](const Datagram&) { ++emitted; });
  EXPECT_EQ(emitted, 1);
}

} // namespace
} // namespace locus
