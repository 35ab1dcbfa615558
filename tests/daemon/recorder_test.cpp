// SPDX-License-Identifier: Apache-2.0
#include "daemon/recorder.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <fstream>
#include <functional>
#include <limits>
#include <thread>
#include <vector>

#include "daemon/allocation_counter.hpp"
#include "daemon/drive.hpp"
#include "drivers/files/capture_folder.hpp"
#include "drivers/files/capture_sequence.hpp"
#include "drivers/files/motion_files.hpp"
#include "support/errors.hpp"
#include "support/patience.hpp"
#include "support/temporary_folder.hpp"

namespace locus::daemon {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr std::uint64_t kMaxBytes = 16'000'000;
constexpr Stamp kNow = stamp_from_ns(1'700'000'000'000'000'000);

/// A folder in memory if there is room, because pieces are synced to disk, which may be busy.
class QuickFolder : public test::TemporaryFolder {
 public:
  QuickFolder() : TemporaryFolder(has_room("/dev/shm") ? "/dev/shm" : testing::TempDir()) {}

 private:
  static bool has_room(const std::filesystem::path& folder) {
    std::error_code error;
    const auto space = std::filesystem::space(folder, error);
    return !error && space.available > 300'000'000;
  }
};

/// Writes a piece of the maximum size.
std::filesystem::path fill_piece(CaptureRing& ring) {
  const auto piece = ring.begin_piece(kNow);
  EXPECT_TRUE(piece) << piece.error();
  std::ofstream{*piece / "lidar.pcap"} << std::string(ring.piece_bytes(), 'x');
  ring.end_piece();
  return *piece;
}

TEST(CaptureRing, OldestPiecesOfAllRunsAreRemovedFirst) {
  const QuickFolder folder;
  CaptureRing first(folder / "record", kMaxBytes);
  std::vector<std::filesystem::path> pieces;
  for (int i = 0; i < 3; ++i)
    pieces.push_back(fill_piece(first));
  EXPECT_EQ(pieces[0], folder / "record/000001_2023-11-14T22-13-20Z/000001");

  CaptureRing second(folder / "record", kMaxBytes);
  while (std::filesystem::exists(pieces[0]) && pieces.size() < 30)
    pieces.push_back(fill_piece(second));
  EXPECT_EQ(pieces[3], folder / "record/000002_2023-11-14T22-13-20Z/000001");
  EXPECT_GE(pieces.size(), 16U);
  EXPECT_LE(second.bytes(), kMaxBytes);
  for (std::size_t i = 1; i < 3; ++i) {
    EXPECT_TRUE(std::filesystem::exists(pieces[i]));
    pieces.push_back(fill_piece(second));
    EXPECT_FALSE(std::filesystem::exists(pieces[i]));
    EXPECT_LE(second.bytes(), kMaxBytes);
  }
  EXPECT_FALSE(std::filesystem::exists(first.run())) << "none of its pieces is left";
}

TEST(CaptureRing, OtherFilesAreNotTouched) {
  const QuickFolder folder;
  const std::filesystem::path record = folder / "record";
  std::filesystem::path run;
  {
    CaptureRing ring(record, kMaxBytes);
    fill_piece(ring);
    run = ring.run();
  }
  std::filesystem::rename(run, record / "keep_the_crash");
  for (const char* other : {"20261122", "000001_notes", "000001_2023-11-14T22-13-20Z.bak"}) {
    std::filesystem::create_directories(record / other / "000001");
    std::ofstream{record / other / "000001/file"} << std::string(1'000'000, 'x');
  }
  CaptureRing ring(record, kMaxBytes);
  for (int i = 0; i < 40; ++i)
    fill_piece(ring);
  EXPECT_TRUE(std::filesystem::exists(record / "keep_the_crash/000001/lidar.pcap"));
  for (const char* other : {"20261122", "000001_notes", "000001_2023-11-14T22-13-20Z.bak"})
    EXPECT_TRUE(std::filesystem::exists(record / other / "000001/file"));
}

TEST(CaptureRing, LoweredLimitIsEnforced) {
  const QuickFolder folder;
  CaptureRing large(folder / "record", 2 * kMaxBytes);
  for (int i = 0; i < 16; ++i)
    fill_piece(large);
  CaptureRing small(folder / "record", kMaxBytes);
  fill_piece(small);
  EXPECT_LE(small.bytes(), kMaxBytes);
}

TEST(CaptureRing, DiscardedPieceLeavesNoFiles) {
  const QuickFolder folder;
  CaptureRing ring(folder / "record", kMaxBytes);
  ASSERT_TRUE(ring.begin_piece(kNow));
  ring.discard_piece();
  EXPECT_TRUE(std::filesystem::is_empty(folder / "record"));
  EXPECT_EQ(ring.bytes(), 0U);
  EXPECT_TRUE(ring.begin_piece(kNow));
}

TEST(CaptureRing, TooSmallDiskIsNotEmptiedInVain) {
  const QuickFolder folder;
  CaptureRing ring(folder / "record", kMaxBytes);
  const std::filesystem::path piece = fill_piece(ring);
  CaptureRing huge(folder / "record", 1'000'000'000'000'000);
  EXPECT_TRUE(contains(error_of(huge.begin_piece(kNow)), "MB free on the disk, 125000000 needed"));
  EXPECT_TRUE(std::filesystem::exists(piece));
}

TEST(CaptureRing, RemovedFolderIsCreatedAgain) {
  const QuickFolder folder;
  CaptureRing ring(folder / "record", kMaxBytes);
  for (int i = 0; i < 3; ++i)
    fill_piece(ring);
  std::filesystem::remove_all(folder / "record");
  EXPECT_TRUE(contains(error_of(ring.begin_piece(kNow)), "record: cannot be read"));
  const std::filesystem::path piece = fill_piece(ring);
  EXPECT_TRUE(std::filesystem::exists(piece));
  EXPECT_LT(ring.bytes(), kMaxBytes / 10) << "what is gone takes no room";
}

TEST(CaptureRing, FolderThatCannotBeCreatedIsAnError) {
  const QuickFolder folder;
  std::ofstream{folder / "plain"} << "a file";
  CaptureRing ring(folder / "plain/record", kMaxBytes);
  for (int attempt = 0; attempt < 2; ++attempt)
    EXPECT_TRUE(contains(error_of(ring.begin_piece(kNow)), "plain/record: cannot be created (Not a directory)"));
}

Config recorded_config() {
  Config config = Drive::config();
  config.record.max_bytes = 1'000'000'000;
  return config;
}

void wait_until(const std::function<bool()>& holds) {
  const auto give_up = std::chrono::steady_clock::now() + test::patience();
  while (!holds() && std::chrono::steady_clock::now() < give_up)
    std::this_thread::sleep_for(milliseconds{1});
}

/// Content of a folder in the order in which locus-replay plays it.
struct Recorded {
  std::vector<Datagram> datagrams; ///< without payload
  std::vector<std::vector<std::byte>> payloads;
  std::vector<ImuSample> imu;
  std::vector<OdometrySample> odometry;
};

Recorded read(const std::filesystem::path& folder) {
  Recorded recorded;
  const auto files = CaptureFolder::find(folder);
  EXPECT_TRUE(files) << files.error();
  auto capture = CaptureSequence::open(files->lidar);
  EXPECT_TRUE(capture) << capture.error();
  while (const Datagram* datagram = capture->next()) {
    recorded.payloads.emplace_back(datagram->payload.begin(), datagram->payload.end());
    recorded.datagrams.push_back(*datagram);
  }
  if (!files->imu.empty())
    recorded.imu = MotionSamples<ImuSample>::open(files->imu)->drain();
  if (!files->odometry.empty())
    recorded.odometry = MotionSamples<OdometrySample>::open(files->odometry.front().files)->drain();
  return recorded;
}

/// A recorder and its disk thread.
struct RunningRecorder : Recorder {
  using Recorder::Recorder;
  Worker disk{"disk", milliseconds{100}, [this](bool last) { write(last); }};
};

/// Records all inputs on a disk that is fast enough.
void record(const std::filesystem::path& folder, const Config& config, std::span<const Input> inputs) {
  Recorder recorder(folder, config, {config.record.max_bytes});
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    recorder.record(inputs[i]);
    if (i % 2000 == 1999)
      recorder.write(false);
  }
  recorder.write(true);
}

bool is_same(const Datagram& a, const Datagram& b) {
  return a.receive_stamp == b.receive_stamp && a.source_ip == b.source_ip && a.source_port == b.source_port &&
         a.destination_port == b.destination_port;
}

/// Many pieces: no bit is lost between them.
TEST(Recorder, EveryBitIsReadBack) {
  const QuickFolder folder;
  Config config = recorded_config();
  config.record.max_bytes = 20'000'000;
  const std::vector<Input>& inputs = Drive::instance().inputs();
  record(folder / "record", config, inputs);
  const Recorded recorded = read(folder / "record");
  EXPECT_GT(CaptureFolder::find(folder / "record")->lidar.size(), 5U);
  std::size_t datagram = 0, imu = 0, odometry = 0;
  for (const Input& input : inputs) {
    if (const auto* sent = std::get_if<Datagram>(&input)) {
      ASSERT_LT(datagram, recorded.datagrams.size());
      EXPECT_TRUE(is_same(recorded.datagrams[datagram], *sent));
      EXPECT_TRUE(std::ranges::equal(recorded.payloads[datagram++], sent->payload));
    } else if (const auto* sample = std::get_if<ImuInput>(&input)) {
      ASSERT_LT(imu, recorded.imu.size());
      const ImuSample& read = recorded.imu[imu++];
      EXPECT_EQ(read.stamp, sample->sample.stamp);
      EXPECT_EQ(read.arrival, sample->sample.arrival);
      EXPECT_EQ(read.angular_velocity_radps, sample->sample.angular_velocity_radps);
      EXPECT_EQ(read.specific_force_mps2, sample->sample.specific_force_mps2);
      ASSERT_EQ(read.attitude.has_value(), sample->sample.attitude.has_value());
      EXPECT_TRUE(!read.attitude || read.attitude->coeffs() == sample->sample.attitude->normalized().coeffs());
    } else {
      ASSERT_LT(odometry, recorded.odometry.size());
      const OdometrySample& read = recorded.odometry[odometry++];
      const auto& wanted = std::get<OdometryInput>(input).sample;
      EXPECT_EQ(read.stamp, wanted.stamp);
      EXPECT_EQ(read.arrival, wanted.arrival);
      EXPECT_EQ(read.covariance_scale, wanted.covariance_scale);
      EXPECT_EQ(read.T_source_base.translation, wanted.T_source_base.translation);
      EXPECT_LT((read.T_source_base.rotation.coeffs() - wanted.T_source_base.rotation.coeffs()).norm(), 1e-15);
    }
  }
  EXPECT_EQ(datagram, recorded.datagrams.size());
  EXPECT_EQ(imu, recorded.imu.size());
  EXPECT_EQ(odometry, recorded.odometry.size());
}

/// Absurd samples of a broken driver must not make the rest unreadable.
TEST(Recorder, AbsurdSamplesAreReadBackOrCountedUnfit) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  const Stamp now = stamp_from_ns(1'700'000'000'000'000'000);
  Config config = recorded_config();
  config.motion_sources.push_back({{"second", SourceKind::imu, {}}, "", ""});
  ImuSample imu{now, now, {kNan, 1, 2}, {1e300, -1e-300, 0}, {}};
  OdometrySample good{now, now + Duration{1}, Pose{}, std::numeric_limits<double>::infinity()};
  OdometrySample no_rotation = good, before_1951 = good;
  no_rotation.T_source_base.rotation.coeffs().setZero();
  before_1951.stamp = stamp_from_ns(-2'000'000'000'000'000'000);
  std::vector<std::byte> longer(2000, std::byte{7});
  Datagram datagram;
  datagram.payload = longer;
  datagram.receive_stamp = now;

  const QuickFolder folder;
  {
    RunningRecorder recorder(folder / "record", config, {config.record.max_bytes});
    for (const OdometrySample& sample : {no_rotation, good, before_1951})
      recorder.record(OdometryInput{SourceId{0}, sample});
    recorder.record(ImuInput{SourceId{1}, imu});
    recorder.record(ImuInput{SourceId{2}, imu});
    recorder.record(datagram);
    recorder.record(Silence{now});
    recorder.record(ExternalHealth{SourceId{0}, false});
    wait_until([&] { return recorder.status().recorded >= 3; });
    EXPECT_EQ(recorder.status().recorded, 3U);
    EXPECT_EQ(recorder.status().unfit, 2U);
    EXPECT_EQ(recorder.status().dropped, 0U) << "and the second IMU has no file";
  }
  const Recorded recorded = read(folder / "record");
  ASSERT_EQ(recorded.imu.size(), 1U);
  EXPECT_TRUE(std::isnan(recorded.imu[0].angular_velocity_radps.x()));
  EXPECT_EQ(recorded.imu[0].specific_force_mps2, imu.specific_force_mps2);
  ASSERT_EQ(recorded.odometry.size(), 1U);
  EXPECT_EQ(recorded.odometry[0].covariance_scale, good.covariance_scale);
  EXPECT_EQ(recorded.odometry[0].arrival, good.arrival);
  ASSERT_EQ(recorded.payloads.size(), 1U);
  EXPECT_GT(recorded.payloads[0].size(), velodyne::kDataPacketBytes) << "as no lidar sends them";
}

TEST(Recorder, InputsBeyondTheDiskRateAreDroppedAndCounted) {
  const QuickFolder folder;
  Recorder recorder(folder / "record", recorded_config(), {recorded_config().record.max_bytes});
  constexpr std::uint64_t kInputs = 4 * Recorder::kMaxUnwritten;
  const ImuInput imu{SourceId{1}, {}};
  for (std::uint64_t i = 0; i < kInputs; ++i)
    recorder.record(imu);
  recorder.write(false);
  EXPECT_EQ(recorder.status().recorded, Recorder::kMaxUnwritten);
  EXPECT_EQ(recorder.status().dropped, kInputs - Recorder::kMaxUnwritten);
  recorder.record(imu);
  recorder.write(true);
  EXPECT_EQ(recorder.status().recorded, Recorder::kMaxUnwritten + 1) << "there is room again";
}

/// An Ouster's packets are longer than a slot of the ring; they are recorded whole and in order.
TEST(Recorder, LongDatagramsAreRecordedWhole) {
  const QuickFolder folder;
  std::vector<std::vector<std::byte>> sent;
  for (const std::size_t bytes : {0U, 1U, 1208U, 1209U, 2416U, 8448U, 33'024U, 48U}) {
    std::vector<std::byte>& payload = sent.emplace_back(bytes);
    for (std::size_t i = 0; i < bytes; ++i)
      payload[i] = static_cast<std::byte>(i * 7 + i / 256 + bytes);
  }
  {
    RunningRecorder recorder(folder / "record", recorded_config(), {recorded_config().record.max_bytes});
    Datagram datagram;
    datagram.receive_stamp = stamp_from_ns(1'700'000'000'000'000'000);
    for (const auto& payload : sent) {
      datagram.payload = payload;
      datagram.receive_stamp += milliseconds{1};
      recorder.record(datagram);
    }
  }
  EXPECT_EQ(read(folder / "record").payloads, sent);
}

/// The input source needs the known lidars for its flood filter, whether or not everything is recorded.
TEST(Recorder, UpdatesTheFilterOfTheSource) {
  struct Source : InputSource {
    const LidarRouter* told = nullptr;
    Input next(Duration /*timeout*/) override { return EndOfInput{}; }
    void update_filter(const LidarRouter& lidars) override { told = &lidars; }
  } source;
  const QuickFolder folder;
  Recorder recorder(folder / "record", recorded_config(), {recorded_config().record.max_bytes});
  const auto lidars = LidarRouter::open(recorded_config().lidars);
  ASSERT_TRUE(lidars);
  RecordingInput(source, recorder).update_filter(*lidars);
  EXPECT_EQ(source.told, &*lidars);
}

TEST(Recorder, CreatesNothingBeforeTheFirstInput) {
  const QuickFolder folder;
  Recorder recorder(folder / "record", recorded_config(), {recorded_config().record.max_bytes});
  for (const bool last : {false, false, true})
    recorder.write(last);
  EXPECT_FALSE(std::filesystem::exists(folder / "record"));
}

/// Only the disk thread may allocate; here there is none.
TEST(Recorder, RecordingAllocatesNothing) {
  if (!allocations())
    GTEST_SKIP() << "a sanitizer is in the way of counting";
  const QuickFolder folder;
  Drive::instance();
  Recorder recorder(folder / "record", recorded_config(), {recorded_config().record.max_bytes});
  DriveInput drive;
  RecordingInput input(drive, recorder);
  const auto before = allocations();
  std::size_t taken = 0;
  while (!std::holds_alternative<EndOfInput>(input.next({})))
    ++taken;
  EXPECT_EQ(allocations(), before);
  EXPECT_EQ(taken, Drive::instance().inputs().size());
}

} // namespace
} // namespace locus::daemon
