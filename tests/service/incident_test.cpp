// SPDX-License-Identifier: Apache-2.0
// Incident recordings of the service, and their replay.
#include <algorithm>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <functional>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <sched.h>
#include <sys/mount.h>

#include <fmt/format.h>

#include "daemon/incidents.hpp"
#include "daemon/machine_time.hpp"
#include "daemon/service/incident_watch.hpp"
#include "drivers/files/capture_folder.hpp"
#include "drivers/velodyne/model.hpp"
#include "service/robot_network.hpp"
#include "support/errors.hpp"
#include "support/led_clock.hpp"
#include "support/udp_sender.hpp"

namespace locus::test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using std::filesystem::path;

std::vector<path> folders_in(const path& folder) {
  std::vector<path> found;
  std::error_code none;
  for (std::filesystem::directory_iterator entry{folder, none}, end; !none && entry != end; entry.increment(none))
    found.push_back(entry->path());
  std::ranges::sort(found);
  return found;
}

std::uint64_t bytes_in(const path& folder) {
  std::uint64_t bytes = 0;
  std::error_code vanished;
  for (std::filesystem::recursive_directory_iterator entry{folder, vanished}, end; !vanished && entry != end;
       entry.increment(vanished))
    bytes += entry->is_regular_file(vanished) ? entry->file_size(vanished) : 0;
  return bytes;
}

class Incident : public RobotNetwork {
 protected:
  /// Mounts separate file systems for the state and for the crash-safe input, as on a robot. Both are in memory, so
  /// that disk latency does not matter.
  void SetUp() override {
    RobotNetwork::SetUp();
    if (IsSkipped() || HasFatalFailure())
      return;
    if (unshare(CLONE_NEWNS) != 0 || mount(nullptr, "/", nullptr, MS_REC | MS_PRIVATE, nullptr) != 0)
      GTEST_SKIP() << "no mounts of one's own: run as root, or allow user namespaces";
    ASSERT_EQ(mount("state", file("").c_str(), "tmpfs", 0, "size=64g"), 0); // sparse: almost nothing is used
    std::filesystem::create_directory(file("run"));
    ASSERT_EQ(mount("run", file("run").c_str(), "tmpfs", 0, "size=400m"), 0);
    use_runtime_folder(file("run"));
  }
  void TearDown() override {
    daemon_.reset();
    umount2(file("run").c_str(), MNT_DETACH);
    umount2(file("").c_str(), MNT_DETACH);
  }

  void reload() const {
    const ProgramRun run = ctl({"reload"});
    ASSERT_EQ(run.status, 0) << run.err;
  }
  [[nodiscard]] nlohmann::json incidents_of_status() const {
    const ProgramRun run = ctl({"status", "--json"});
    EXPECT_EQ(run.status, 0) << run.err;
    return nlohmann::json::parse(run.out, nullptr, false)["incidents"];
  }

  /// Waits until the lidar has sent this fraction of the drive.
  [[nodiscard]] bool has_driven(double part) const {
    const double wanted = part * static_cast<double>(datagrams_in(plant() / "lidar.pcap"));
    return comes_true([&] {
      const auto status = nlohmann::json::parse(ctl({"status", "--json"}).out, nullptr, false);
      return status.is_object() && status["packets"]["total"]["received"].get<double>() >= wanted;
    });
  }

  [[nodiscard]] path with(const std::string& record) const {
    path config = file("locusd.yaml");
    std::ofstream{config} << read_text(plant() / "config.yaml") << "record: {" << record << "}\n";
    return config;
  }

  void start(const std::string& record) { start(locusd(with(record)), endlessly(plant())); }
  /// Starts a service on a clock that the player moves, and that stands still at a time of the drive.
  void start_led(const std::string& record, Duration until, const std::vector<std::string>& drive) {
    led_service_ = led_locusd(with(record));
    led_time().hold_at_ns = until.count();
    start(led_service_, leading_play(drive));
  }
  void start(std::vector<std::string> service, std::vector<std::string> player) {
    daemon_.emplace(std::move(service));
    listener_.emplace(std::vector<std::string>{CYCLONE_PEER, "0", "listen", "/locus"});
    ASSERT_TRUE(daemon_->wait_for_line("DDS is up"));
    ASSERT_TRUE(hears_the_service(*listener_));
    play_.emplace(std::move(player));
    ASSERT_TRUE(daemon_->wait_for_line("tracking"));
  }

  /// Expects at least `poses` poses of the replay to equal the live ones, after alignment of the first common pose. A
  /// replay that starts in mid-drive cuts its sweeps at other times: live poses, 0.1 s apart, are interpolated
  /// linearly.
  static void expect_same_estimates(const Replay& replay, const std::vector<HeardPose>& live, std::size_t poses) {
    std::optional<Pose> T_live_replay;
    Eigen::Vector3d last = Eigen::Vector3d::Zero();
    std::size_t compared = 0;
    double way_m = 0, worst_m = 0;
    for (const StampedPose& pose : replay.trajectory()) {
      const auto after = std::ranges::lower_bound(live, pose.stamp, {}, &HeardPose::stamp);
      if (after == live.begin() || after == live.end())
        continue;
      const HeardPose& before = *std::prev(after);
      const Duration gap = after->stamp - before.stamp;
      if (gap > milliseconds{150})
        continue;
      const Pose T_odom_base =
          interpolate(before.T_odom_base, after->T_odom_base, to_seconds(pose.stamp - before.stamp) / to_seconds(gap));
      if (!T_live_replay) {
        T_live_replay = T_odom_base * pose.T_source_base.inverse();
        last = T_odom_base.translation;
      }
      way_m += (T_odom_base.translation - last).norm();
      last = T_odom_base.translation;
      const double error_m = ((*T_live_replay * pose.T_source_base).translation - last).norm();
      EXPECT_LT(error_m, 0.02 + 0.005 * way_m) << "after " << way_m << " m";
      worst_m = std::max(worst_m, error_m);
      ++compared;
    }
    EXPECT_GE(compared, poses) << "of " << live.size() << " that were heard";
    EXPECT_GT(way_m, 1.0) << "it drives";
    RecordProperty("way_m_of_" + std::to_string(compared), std::to_string(way_m));
    RecordProperty("worst_mm_of_" + std::to_string(compared), std::to_string(1e3 * worst_m));
  }

  /// Requests an incident in mid-drive, and replays the recording after the drive.
  void keep_and_replay(const std::string& record, const std::function<void(const Replay&)>& judge) {
    ASSERT_NO_FATAL_FAILURE(start_led(record, seconds{14}, {plant().string()}));
    ASSERT_TRUE(is_held());
    const ProgramRun kept = ctl({"record", "--keep", "8s"});
    ASSERT_EQ(kept.status, 0) << kept.err;
    const path folder = kept.out.substr(0, kept.out.find('\n'));
    EXPECT_EQ(folder.parent_path(), file("incidents"));
    EXPECT_TRUE(folder.string().ends_with("Z_asked")) << folder;
    EXPECT_EQ(incidents_of_status()["last"], folder.string());
    EXPECT_TRUE(contains(ctl({"status"}).out, "incident    " + folder.filename().string()));
    EXPECT_EQ(runs_in(file("run/input-ring")).size(), record == "keep_s: 8" ? 1U : 0U) << "nothing is written twice";
    const nlohmann::json why = nlohmann::json::parse(read_text(folder / "why.json"));
    EXPECT_EQ(why["why"], "asked");
    EXPECT_TRUE(why["status"].contains("state"));
    EXPECT_TRUE(why["status"].contains("pose"));
    EXPECT_FALSE(why["version"].get<std::string>().empty());
    led_time().hold_at_ns = 0;
    ASSERT_EQ(play_->wait_for_exit(patience_of_a_drive()), 0) << testing::PrintToString(play_->lines());
    daemon_->signal(SIGTERM);
    ASSERT_EQ(daemon_->wait_for_exit(), 0);
    EXPECT_FALSE(std::filesystem::exists(file("run/input-ring")));
    const Replay replay({"--quiet", folder.string()});
    ASSERT_EQ(replay.run().status, 0) << replay.run().err;
    judge(replay);
    std::filesystem::remove(file("state"));
  }

  /// Waits until a crash has something to leave: this many data packets in the runtime folder, which the disk thread
  /// then marks as a run, and a state.
  [[nodiscard]] bool is_stored(std::uint64_t packets) const {
    return comes_true([&] {
      return bytes_in(file("run/input-ring")) > packets * velodyne::kDataPacketBytes &&
             std::filesystem::exists(file("run/input-ring/run")) && std::filesystem::exists(file("state"));
    });
  }

  /// Kills the service in mid-drive, restarts it, and replays the recording of the crashed process.
  void crash_and_replay(const std::function<void(const Replay&, const std::vector<HeardPose>&)>& judge) {
    ASSERT_NO_FATAL_FAILURE(start_led("keep_s: 10", seconds{6}, {plant().string()}));
    ASSERT_TRUE(is_held());
    const auto data = status()["packets"]["total"]["data"].get<std::uint64_t>();
    ASSERT_TRUE(is_stored(data));
    ASSERT_TRUE(comes_true([&] { return heard(*listener_).size() > 50; }));
    daemon_->signal(SIGKILL);
    ASSERT_TRUE(daemon_->wait_for_exit());
    const std::vector<HeardPose> live = heard(*listener_);
    daemon_.emplace(led_service_);
    ASSERT_TRUE(daemon_->wait_for_line("the latest input is stored in")) << testing::PrintToString(daemon_->lines());
    const std::vector<path> kept = folders_in(file("incidents"));
    ASSERT_EQ(kept.size(), 1U);
    EXPECT_TRUE(kept[0].string().ends_with("Z_restart")) << kept[0];
    const nlohmann::json why = nlohmann::json::parse(read_text(kept[0] / "why.json"));
    EXPECT_EQ(why["why"], "restart");
    EXPECT_EQ(why["pose"]["xyz_m"].size(), 3U) << "where the robot was";
    const Replay replay({"--quiet", kept[0].string()});
    ASSERT_EQ(replay.run().status, 0) << replay.run().err;
    judge(replay, live);
  }

  std::vector<std::string> led_service_;
  std::optional<Child> daemon_, listener_, play_;
};

TEST_F(Incident, RequestedIncidentReplaysToTheSameEstimate) {
  for (const char* record : {"keep_s: 8", "keep_s: 8, folder: record"})
    ASSERT_NO_FATAL_FAILURE(keep_and_replay(record, [this](const Replay& replay) {
      EXPECT_GT(replay.trajectory().size(), 50U);
      EXPECT_LT(replay.trajectory().size(), 180U) << "the last of it, not all";
      expect_same_estimates(replay, heard(*listener_), 70);
    }));
}

/// Foreign files in the runtime folder stay; a service that ends removes only its own.
TEST_F(Incident, SecondServiceOnTheSameFolderChangesNothing) {
  for (const char* mine : {"run/ring/mine", "run/incident/mine", "run/input-ring/mine"})
    std::filesystem::create_directories(file(mine));
  std::ofstream{file("run/run")} << "mine";
  ASSERT_NO_FATAL_FAILURE(start("keep_s: 10"));
  ASSERT_TRUE(comes_true([this] { return std::filesystem::exists(file("run/input-ring/run")); }));
  const std::vector<path> runs = runs_in(file("run/input-ring"));
  ASSERT_EQ(runs.size(), 1U);
  const std::string mark = read_text(file("run/input-ring/run"));
  EXPECT_EQ(mark, runs.front().string());
  {
    Child second(locusd(lidar_with("port: 2390")));
    EXPECT_TRUE(second.wait_for_line("and no incidents are stored: another service uses it"));
    EXPECT_TRUE(second.wait_for_line("DDS is up")) << testing::PrintToString(second.lines());
    second.signal(SIGTERM);
    EXPECT_EQ(second.wait_for_exit(), 0);
  }
  EXPECT_EQ(runs_in(file("run/input-ring")), runs);
  EXPECT_EQ(read_text(file("run/input-ring/run")), mark);
  EXPECT_TRUE(folders_in(file("incidents")).empty());
  EXPECT_EQ(ctl({"record", "--keep", "10s"}).status, 0);
  static_cast<void>(with("keep_s: 0"));
  ASSERT_NO_FATAL_FAILURE(reload());
  EXPECT_TRUE(comes_true([this] {
    return folders_in(file("run/input-ring")) == std::vector<path>{file("run/input-ring/mine")};
  })) << "no memory is held";
  daemon_->signal(SIGTERM);
  ASSERT_EQ(daemon_->wait_for_exit(), 0);
  for (const char* mine : {"run/ring/mine", "run/incident/mine", "run/input-ring/mine", "run/run"})
    EXPECT_TRUE(std::filesystem::exists(file(mine))) << mine;
}

/// Neither a disk nor a tiny tmpfs stores the input; a recording folder does.
TEST_F(Incident, NeedsATmpfsThatIsLargeEnough) {
  const auto expect_none = [this](const char* why) {
    daemon_.emplace(locusd(with("keep_s: 10")));
    ASSERT_TRUE(daemon_->wait_for_line(why)) << testing::PrintToString(daemon_->lines());
    ASSERT_TRUE(daemon_->wait_for_line("DDS is up"));
    play_.emplace(endlessly(plant()));
    ASSERT_TRUE(daemon_->wait_for_line("tracking"));
    EXPECT_FALSE(std::filesystem::exists(file("run/input-ring")));
    const ProgramRun kept = ctl({"record", "--keep", "10s"});
    EXPECT_EQ(kept.status, 1);
    EXPECT_TRUE(contains(kept.err, "a tmpfs as RUNTIME_DIRECTORY, or record.folder")) << kept.err;
    static_cast<void>(with("keep_s: 10, folder: record"));
    ASSERT_NO_FATAL_FAILURE(reload());
    EXPECT_TRUE(comes_true([this] { return ctl({"record", "--keep", "10s"}).status == 0; }));
    play_.reset();
    daemon_.reset();
    std::filesystem::remove(file("state"));
  };
  umount2(file("run").c_str(), MNT_DETACH);
  ASSERT_EQ(mount("run", file("run").c_str(), "ramfs", 0, nullptr), 0);
  ASSERT_NO_FATAL_FAILURE(expect_none("run: is not a tmpfs, so no input is stored there for incidents; mount a tmpfs"));
  umount2(file("run").c_str(), MNT_DETACH);
  ASSERT_EQ(mount("run", file("run").c_str(), "tmpfs", 0, "size=30m"), 0);
  ASSERT_NO_FATAL_FAILURE(expect_none("run: is too small, so no input is stored there for incidents; mount a tmpfs"));
}

/// A crash during a drive becomes an incident; the next crash follows too soon and does not.
TEST_F(Incident, CrashStoresAnIncidentAndAStopDoesNot) {
  ASSERT_NO_FATAL_FAILURE(
      crash_and_replay([](const Replay& replay, const auto& /*live*/) { EXPECT_GT(replay.trajectory().size(), 30U); }));
  ASSERT_TRUE(status_comes([](const nlohmann::json& now) {
    return std::ranges::all_of(now["sources"], [](const auto& source) { return source["writers"] == 1; });
  }));
  led_time().hold_at_ns = Duration{seconds{8}}.count();
  ASSERT_TRUE(is_held() && is_stored(100));
  daemon_->signal(SIGKILL);
  ASSERT_TRUE(daemon_->wait_for_exit());
  daemon_.emplace(led_service_);
  ASSERT_TRUE(daemon_->wait_for_line("DDS is up"));
  EXPECT_TRUE(comes_true([this] { return incidents_of_status()["suppressed"] == 1; }));
  daemon_->signal(SIGTERM);
  ASSERT_EQ(daemon_->wait_for_exit(), 0);
  daemon_.emplace(led_service_);
  ASSERT_TRUE(daemon_->wait_for_line("DDS is up"));
  EXPECT_EQ(incidents_of_status()["suppressed"], 0);
  EXPECT_EQ(folders_in(file("incidents")).size(), 1U);
}

TEST_F(Incident, CrashReplaysToTheSameEstimate) {
  ASSERT_NO_FATAL_FAILURE(crash_and_replay(
      [](const Replay& replay, const std::vector<HeardPose>& live) { expect_same_estimates(replay, live, 45); }));
}

/// The lidar is unplugged, and the wheels continue.
TEST_F(Incident, LossOfTrackingStoresAnIncident) {
  const path robot = file("robot");
  const ProgramRun sim = run_program(LOCUS_SIM, {"--world", "urban", "--robot", "husky", "--duration", "12", "--seed",
                                                 "3", "--realism", "clean", "-o", robot.string()});
  ASSERT_EQ(sim.status, 0) << sim.err;
  ASSERT_NO_FATAL_FAILURE(start_led("keep_s: 10", seconds{7}, {"--fail", "all-lidars:lost@5-12", robot.string()}));
  ASSERT_TRUE(daemon_->wait_for_line("the latest input is stored in")) << testing::PrintToString(daemon_->lines());
  const std::vector<path> kept = folders_in(file("incidents"));
  ASSERT_EQ(kept.size(), 1U);
  EXPECT_TRUE(kept[0].string().ends_with("Z_tracking_lost")) << kept[0];
  EXPECT_EQ(nlohmann::json::parse(read_text(kept[0] / "why.json"))["status"]["state"], "dead_reckoning");
  const Replay replay({"--quiet", kept[0].string()});
  EXPECT_EQ(replay.run().status, 0) << replay.run().err;
  EXPECT_GT(replay.trajectory().size(), 30U);
}

TEST_F(Incident, FailureToStoreIsReported) {
  daemon_.emplace(locusd(with("keep_s: 10")));
  ASSERT_TRUE(daemon_->wait_for_line("DDS is up"));
  const ProgramRun nothing = ctl({"record", "--keep", "10s"});
  EXPECT_EQ(nothing.status, 1);
  EXPECT_TRUE(contains(nothing.err, "no input was received")) << nothing.err;
  EXPECT_EQ(incidents_of_status()["problem"], "") << "what was refused is no fault of the service";
  const ProgramRun more = ctl({"record", "--keep", "11s"});
  EXPECT_EQ(more.status, 2);
  EXPECT_TRUE(contains(more.err, "at most 10s can be stored; see record.keep_s")) << more.err;
  for (const char* wrong : {"", "x", "10m", "nan", "-1", "1e9", "0"})
    EXPECT_EQ(ctl({"record", "--keep", wrong}).status, 2) << wrong;
  EXPECT_TRUE(contains(ctl({"record", "--keep", "nan"}).err, "--keep nan: must be seconds, e.g. 60s"));
  EXPECT_EQ(ctl({"record"}).status, 2);
  static_cast<void>(with("keep_s: 0"));
  ASSERT_NO_FATAL_FAILURE(reload());
  const ProgramRun off = ctl({"record", "--keep", "1s"});
  EXPECT_EQ(off.status, 1);
  EXPECT_TRUE(contains(off.err, "set record.keep_s")) << off.err;
}

TEST_F(Incident, FullDiskOrUnusableFolderIsReportedAndTheOdometryContinues) {
  std::filesystem::create_directory(file("incidents"));
  ASSERT_EQ(mount("incidents", file("incidents").c_str(), "tmpfs", 0, "size=3m"), 0);
  const path older = file("incidents/2026-01-01T00-00-00.000Z_asked");
  std::filesystem::create_directory(older);
  ASSERT_NO_FATAL_FAILURE(start("keep_s: 10"));
  ASSERT_TRUE(has_driven(0.2));
  const ProgramRun full = ctl({"record", "--keep", "10s"});
  EXPECT_EQ(full.status, 1);
  EXPECT_TRUE(contains(full.err, "MB free on the disk")) << full.err;
  EXPECT_EQ(folders_in(file("incidents")), std::vector<path>{older}) << "nothing is left of it, nor given for it";
  EXPECT_TRUE(folders_in(file("run/input-ring/.incident.part")).empty());
  umount2(file("incidents").c_str(), MNT_DETACH);
  std::filesystem::remove(file("incidents"));
  std::ofstream{file("incidents")} << "a file";
  const ProgramRun no_folder = ctl({"record", "--keep", "10s"});
  EXPECT_EQ(no_folder.status, 1);
  EXPECT_TRUE(contains(no_folder.err, "incidents: the incident cannot be stored (Not a directory)")) << no_folder.err;
  EXPECT_TRUE(daemon_->wait_for_line("(Not a directory); let locusd write there"));
  std::filesystem::remove(file("incidents"));
  EXPECT_EQ(ctl({"record", "--keep", "10s"}).status, 0) << "as soon as it can be";
  EXPECT_EQ(folders_in(file("incidents")).size(), 1U);
}

/// A flood of ten times the lidar's packet rate: the memory bound holds, and the recording covers less time.
TEST_F(Incident, FloodFillsNoMoreThanTheLimit) {
  constexpr std::uint64_t kBytes = 10'000'000;
  ASSERT_NO_FATAL_FAILURE(start(fmt::format("keep_s: 60, keep_bytes: {}", kBytes)));
  const UdpSender pest(0x7F000002);
  const std::vector<std::byte> packet(velodyne::kDataPacketBytes);
  std::uint64_t most = 0;
  const auto give_up = std::chrono::steady_clock::now() + patience();
  for (int i = 0; i < 600 || (most < kBytes / 2 && std::chrono::steady_clock::now() < give_up); ++i) {
    for (int k = 0; k < 75; ++k)
      pest.send(2368, packet);
    if (i % 20 == 0)
      most = std::max(most, bytes_in(file("run/input-ring")));
    std::this_thread::sleep_for(milliseconds{10});
  }
  EXPECT_LE(most, kBytes);
  EXPECT_GE(most, kBytes / 2);
  EXPECT_EQ(ctl({"record", "--keep", "60s"}).status, 0);
  EXPECT_LE(bytes_in(file("incidents")), kBytes + 100'000);

  const Child asks({LOCUSCTL, "--socket", file("run/control").string(), "record", "--keep", "60s"});
  const auto begun = std::chrono::steady_clock::now();
  while (folders_in(file("incidents")).size() < 2 && std::chrono::steady_clock::now() - begun < patience())
    std::this_thread::sleep_for(milliseconds{1});
  static_cast<void>(with("keep_s: 0")); // during the copy
  ASSERT_NO_FATAL_FAILURE(reload());
  const auto is_complete = [](const path& incident) { return std::filesystem::exists(incident / "why.json"); };
  EXPECT_TRUE(comes_true([&] { return std::ranges::count_if(folders_in(file("incidents")), is_complete) == 2; }))
      << "what was begun is brought to its end";
  EXPECT_TRUE(asks.wait_for_line("Z_asked")) << testing::PrintToString(asks.lines());
  EXPECT_TRUE(comes_true([this] { return folders_in(file("run/input-ring")).empty(); }))
      << "no memory is held for what is off";
}

/// Consecutive requests; the folder stays within its size limit.
TEST(IncidentFolder, OldestIsRemovedFirst) {
  const TemporaryFolder folder;
  const path piece = folder / "record/000001_2026-11-22T08-12-05Z/000001";
  std::filesystem::create_directories(piece);
  std::ofstream{piece / "lidar.pcap"} << std::string(1'000'000, 'x');
  daemon::Incidents incidents(folder / "incidents");
  incidents.set_max_bytes(3'500'000);
  const auto keep = [&](int second) {
    const auto where = incidents.submit(
        {daemon::IncidentCause::asked, seconds{60}, Stamp{seconds{1'800'000'000 + second}}, "{}", {piece}});
    EXPECT_TRUE(where);
    EXPECT_FALSE(incidents.submit({})) << "one at a time";
    incidents.work(nullptr);
    incidents.work(nullptr);
    EXPECT_EQ(incidents.status().refusal, "");
    EXPECT_EQ(incidents.status().last, *where);
    return *where;
  };
  std::vector<path> all;
  for (int second = 0; second < 5; ++second)
    all.push_back(keep(second));
  EXPECT_EQ(folders_in(folder / "incidents"), std::vector<path>(all.begin() + 2, all.end()));
  EXPECT_TRUE(std::filesystem::exists(all.back() / "000001/lidar.pcap"));
  incidents.set_max_bytes(900'000);
  ASSERT_TRUE(
      incidents.submit({daemon::IncidentCause::asked, seconds{60}, Stamp{seconds{1'900'000'000}}, "{}", {piece}}));
  incidents.work(nullptr);
  EXPECT_TRUE(contains(incidents.status().refusal, "it has 1 MB, and 0 are allowed); raise record.incidents_bytes"))
      << incidents.status().refusal;
  EXPECT_EQ(folders_in(folder / "incidents").size(), 3U) << "none is given for nothing";
}

/// Automatic incidents are limited to one in five minutes, across processes.
TEST(IncidentFolder, IncidentsTooSoonAreCounted) {
  const TemporaryFolder folder;
  const path piece = folder / "record/000001_2026-11-22T08-12-05Z/000001";
  std::filesystem::create_directories(piece);
  std::ofstream{piece / "lidar.pcap"} << "x";
  const auto file_now = std::filesystem::file_time_type::clock::now();
  const Stamp now{std::chrono::file_clock::to_sys(file_now).time_since_epoch()};
  const auto request = [&](Duration later) {
    return daemon::Incidents::Request{daemon::IncidentCause::contradiction, seconds{60}, now + later, "{}", {piece}};
  };
  for (int process = 0; process < 2; ++process) {
    for (const path& kept : folders_in(folder / "incidents"))
      std::filesystem::last_write_time(kept, file_now);
    daemon::Incidents incidents(folder / "incidents");
    incidents.set_max_bytes(10'000'000);
    for (const seconds later : {seconds{0}, seconds{299}, seconds{300 + process}}) {
      incidents.raise(request(later));
      incidents.work(nullptr);
      incidents.work(nullptr);
    }
    EXPECT_EQ(incidents.status().suppressed, process == 0 ? 1U : 2U);
    EXPECT_EQ(incidents.status().problem, "");
  }
}

/// State after a step of the clock by minus one year.
TEST(IncidentFolder, FutureIncidentSuppressesNoneOfToday) {
  const TemporaryFolder folder;
  const path piece = folder / "record/000001_2026-11-22T08-12-05Z/000001";
  std::filesystem::create_directories(piece);
  std::ofstream{piece / "lidar.pcap"} << "x";
  const auto file_now = std::filesystem::file_time_type::clock::now();
  for (const auto& [name, age] : {std::pair{"2026-11-22T08-12-05.123Z_restart", Duration{seconds{10}}},
                                  std::pair{"2027-11-22T08-12-05.123Z_restart", Duration{-std::chrono::hours{8760}}}}) {
    std::filesystem::create_directories(folder / "incidents" / name);
    std::filesystem::last_write_time(folder / "incidents" / name, file_now - age);
  }
  for (const char* part : {"notes.part", "2026-11-22T08-12-05.123Z_restart.part"})
    std::filesystem::create_directories(folder / "incidents" / part);
  daemon::Incidents incidents(folder / "incidents");
  incidents.set_max_bytes(10'000'000);
  EXPECT_EQ(folders_in(folder / "incidents").size(), 3U) << "what was not completed is gone, and that alone";
  const auto request = [&](daemon::IncidentCause cause) {
    return daemon::Incidents::Request{cause, seconds{60}, Stamp{daemon::read_clock(CLOCK_REALTIME)}, "{}", {piece}};
  };
  EXPECT_FALSE(incidents.raise(request(daemon::IncidentCause::restart)));
  EXPECT_TRUE(incidents.submit(request(daemon::IncidentCause::asked)));
  EXPECT_FALSE(incidents.raise(request(daemon::IncidentCause::tracking_lost))) << "another one is on its way";
  incidents.work(nullptr);
  incidents.work(nullptr);
  EXPECT_TRUE(incidents.raise(request(daemon::IncidentCause::tracking_lost)))
      << "it was not kept, so this is the first";
  EXPECT_EQ(incidents.status().suppressed, 2U);
}

/// Figures and time of a service, both set by the test.
class IncidentWatchTest : public testing::Test {
 protected:
  std::optional<daemon::IncidentCause> look_after(Duration while_nothing_changes) {
    now_ += while_nothing_changes;
    return watch_.check(figures_);
  }
  void estimate(TrackingState state) { figures_.sweeps.last.emplace().state = state; }
  void refuse(HealthReason reason) {
    ++figures_.ingest.sources.front().counters.rejected[static_cast<std::size_t>(reason)];
  }

  static inline Duration now_ = std::chrono::hours{1};
  Config config_;
  daemon::Figures figures_{config_};
  daemon::IncidentWatch watch_{[](clockid_t /*clock*/) { return now_; }};
};

/// One contradiction lasts as long as samples are rejected consecutively.
TEST_F(IncidentWatchTest, ContradictionsWithinTenSecondsAreOne) {
  EXPECT_FALSE(look_after(seconds{1}));
  refuse(HealthReason::disagreement);
  EXPECT_EQ(look_after(seconds{1}), daemon::IncidentCause::contradiction);
  for (int i = 0; i < 5; ++i) {
    refuse(i % 2 == 0 ? HealthReason::self_check : HealthReason::disagreement);
    EXPECT_FALSE(look_after(daemon::IncidentWatch::kMinGap - Duration{1}));
  }
  EXPECT_FALSE(look_after(daemon::IncidentWatch::kMinGap));
  refuse(HealthReason::disagreement);
  EXPECT_EQ(look_after(Duration{1}), daemon::IncidentCause::contradiction);
  refuse(HealthReason::stale);
  EXPECT_FALSE(look_after(std::chrono::hours{1})) << "who is silent contradicts nobody";
}

TEST_F(IncidentWatchTest, OneSecondOfDeadReckoningIsOneLoss) {
  estimate(TrackingState::dead_reckoning);
  EXPECT_FALSE(look_after(seconds{1}));
  EXPECT_FALSE(look_after(std::chrono::hours{1})) << "it has not tracked yet";
  for (int turn = 0; turn < 2; ++turn) {
    estimate(TrackingState::tracking);
    EXPECT_FALSE(look_after(seconds{1}));
    estimate(TrackingState::dead_reckoning);
    EXPECT_FALSE(look_after(seconds{1}));
    EXPECT_FALSE(look_after(daemon::IncidentWatch::kMinLoss - Duration{1}));
    EXPECT_EQ(look_after(Duration{1}), daemon::IncidentCause::tracking_lost);
    EXPECT_FALSE(look_after(std::chrono::hours{1})) << "once";
  }
}

} // namespace
} // namespace locus::test
