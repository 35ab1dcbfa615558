// SPDX-License-Identifier: Apache-2.0
// Drives in which a sensor fails and returns.
#include <algorithm>
#include <cmath>
#include <ostream>

#include <gtest/gtest.h>

#include "replay_run.hpp"
#include "support/test_drives.hpp"

namespace locus::test {
namespace {

using nlohmann::json;
using std::chrono::milliseconds;
using std::chrono::seconds;

/// Replays the room drive with a fault.
Replay replay_with(const std::string& fault) { return Replay({room_drive().string(), "--fail", fault}); }

const std::vector<StampedPose>& path_without_faults() {
  static const std::vector<StampedPose> path = Replay({room_drive().string()}).trajectory();
  return path;
}

/// Returns the largest distance between two paths of the same sweeps.
double farthest_apart_m(const std::vector<StampedPose>& path, const std::vector<StampedPose>& other) {
  EXPECT_EQ(path.size(), other.size()) << "no sweep is lost";
  double farthest_m = 0.0;
  for (std::size_t i = 0; i < std::min(path.size(), other.size()); ++i)
    farthest_m = std::max(farthest_m, (path[i].T_source_base.translation - other[i].T_source_base.translation).norm());
  return farthest_m;
}

/// Returns the largest motion between two sweeps beyond that of the path without faults.
double greatest_jump_m(const std::vector<StampedPose>& path, const std::vector<StampedPose>& without_faults) {
  double greatest_m = 0.0;
  for (std::size_t i = 1; i < std::min(path.size(), without_faults.size()); ++i) {
    const auto step = [i](const std::vector<StampedPose>& of) {
      return of[i - 1].T_source_base.inverse() * of[i].T_source_base;
    };
    greatest_m = std::max(greatest_m, (step(path).translation - step(without_faults).translation).norm());
  }
  return greatest_m;
}

Duration after_start(const std::vector<StampedPose>& path, std::size_t row) { return path[row].stamp - path[0].stamp; }

struct SourceFault {
  std::string source, kind; ///< in the syntax of --fail
  std::string reason;       ///< counter of rejections
};
std::ostream& operator<<(std::ostream& out, const SourceFault& fault) {
  return out << fault.source << ' ' << fault.kind;
}

class FaultOfASource : public testing::TestWithParam<SourceFault> {};

TEST_P(FaultOfASource, IsDetectedCountedAndSurvivedAndTheSourceReturns) {
  const SourceFault& fault = GetParam();
  const Replay replay = replay_with(fault.source + ":" + fault.kind + "@2-4");
  ASSERT_EQ(replay.run().status, 0) << replay.run().err;
  const json summary = replay.summary();
  const json& source = summary["sources"][fault.source];
  EXPECT_GE(source["rejected"][fault.reason].get<int>(), 1);
  EXPECT_GE(source["health_changes"].get<int>(), 2);
  EXPECT_EQ(source["health_changes"].get<int>() % 2, 0) << "it ends in health";
  const std::string other = fault.source == "imu" ? "wio" : "imu";
  EXPECT_EQ(summary["sources"][other]["health_changes"], 0);

  EXPECT_EQ(summary["sweeps"]["failed"], 0);
  const auto path = replay.trajectory();
  EXPECT_LT(farthest_apart_m(path, path_without_faults()), 0.02);
  EXPECT_LT(greatest_jump_m(path, path_without_faults()), 0.025);

  const auto table = replay.table();
  const auto used_in = [&](std::size_t row) { return table[row + 1][2].find(fault.source) != std::string::npos; };
  bool dropped = false;
  for (std::size_t row = 1; row < path.size(); ++row) {
    const Duration now = after_start(path, row);
    if (now < milliseconds{1800} || now > milliseconds{5500}) {
      EXPECT_TRUE(used_in(row)) << "used for sweep " << row;
    }
    dropped = dropped || !used_in(row);
  }
  EXPECT_TRUE(dropped);
}

INSTANTIATE_TEST_SUITE_P(Replay, FaultOfASource,
                         testing::Values(SourceFault{"wio", "lost", "stale"}, SourceFault{"wio", "frozen", "frozen"},
                                         SourceFault{"wio", "jump", "jump"}, SourceFault{"wio", "nan", "nan"},
                                         SourceFault{"wio", "late", "stale"},
                                         SourceFault{"wio", "covariance", "covariance"},
                                         SourceFault{"wio", "clock-step=3600", "out_of_order"},
                                         SourceFault{"imu", "lost", "stale"}, SourceFault{"imu", "frozen", "frozen"},
                                         SourceFault{"imu", "nan", "nan"}, SourceFault{"imu", "late", "stale"},
                                         SourceFault{"imu", "clock-step=3600", "out_of_order"}),
                         [](const auto& test) {
                           std::string name = test.param.source + "_" + test.param.kind;
                           std::ranges::replace_if(
                               name, [](char c) { return c == '-' || c == '='; }, '_');
                           return name;
                         });

TEST(Faults, DisorderedSamplesAreCountedAndChangeNoHealth) {
  for (const std::string kind : {"reorder", "duplicate"}) {
    const Replay replay({room_drive().string(), "--fail", "wio:" + kind + "@1", "--fail", "imu:" + kind + "@1"});
    const json summary = replay.summary();
    for (const std::string source : {"wio", "imu"}) {
      EXPECT_GT(summary["sources"][source]["rejected"]["out_of_order"].get<int>(), 10);
      EXPECT_EQ(summary["sources"][source]["health_changes"], 0);
    }
    EXPECT_LT(farthest_apart_m(replay.trajectory(), path_without_faults()), 0.01);
  }
}

TEST(Faults, WithoutFaultsHealthNeverChanges) {
  const json sources = Replay({room_drive().string()}).summary()["sources"];
  for (const auto& [name, source] : sources.items()) {
    EXPECT_EQ(source["health_changes"], 0) << name;
    for (const auto& [reason, count] : source["rejected"].items())
      EXPECT_EQ(count, 0) << name << ' ' << reason;
  }
}

/// Times are relative to the same origin as those of --fail; the first sweep ends 0.1 s after it.
TEST(Faults, TimesArePrintedFromTheStartOfTheCapture) {
  const auto lost_at_s = [](std::vector<std::string> arguments) {
    arguments.insert(arguments.end(), {room_drive().string(), "--fail", "wio:lost@3-5"});
    const std::string said = Replay(arguments).run().out, key = ", lost at ";
    const std::size_t at = said.find(key);
    EXPECT_NE(at, std::string::npos) << said;
    return at == std::string::npos ? 0.0 : std::stod(said.substr(at + key.size()));
  };
  const double lost_s = lost_at_s({});
  EXPECT_GE(lost_s, 3.0);
  EXPECT_LT(lost_s, 3.1);
  EXPECT_NEAR(lost_at_s({"--start", "1.5"}), lost_s, 0.03);
}

TEST(Faults, LidarContinuesWithoutWheelsAndGyro) {
  const Replay replay({room_drive().string(), "--fail", "wio:lost@4", "--fail", "imu:lost@4"});
  EXPECT_EQ(replay.summary()["sweeps"]["failed"], 0);
  EXPECT_LT(farthest_apart_m(replay.trajectory(), path_without_faults()), 0.05);
  EXPECT_EQ(replay.table().back()[2], "constant_velocity");
}

TEST(Faults, WithoutLidarSourcesDeadReckonAndLidarRelocalises) {
  const Replay replay = replay_with("all-lidars:lost@3-5");
  ASSERT_EQ(replay.run().status, 0) << replay.run().err;
  const auto path = replay.trajectory();
  const auto table = replay.table();
  const auto variance_of_x = [&](std::size_t row) { return std::stod(table[row + 1][5]); };
  EXPECT_LT(farthest_apart_m(path, path_without_faults()), 0.1);
  for (std::size_t row = 1; row < path.size(); ++row) {
    const Duration now = after_start(path, row);
    if (now > milliseconds{3100} && now < milliseconds{4700}) {
      EXPECT_EQ(table[row + 1][1], "dead_reckoning");
      EXPECT_EQ(table[row + 1][2], "imu+wio");
      EXPECT_GT(variance_of_x(row), variance_of_x(row - 1));
    }
    if (now < milliseconds{2700} || now > milliseconds{5300}) {
      EXPECT_NE(table[row + 1][1], "dead_reckoning");
    }
  }
  EXPECT_LT((path.back().T_source_base.translation - path_without_faults().back().T_source_base.translation).norm(),
            0.01);
  EXPECT_LT(variance_of_x(path.size() - 1), variance_of_x(40)) << "lidar has corrected the accumulated drift";
}

/// Neither the capture nor the configuration is to blame.
TEST(Faults, LossOfEveryPacketIsNamedAsTheReason) {
  const Replay replay = replay_with("all-lidars:lost@0");
  EXPECT_EQ(replay.run().status, 1);
  EXPECT_EQ(lines_of(replay.run().err).size(), 1U) << replay.run().err;
  EXPECT_NE(replay.run().err.find("no valid data packet: --fail all-lidars:lost removes all "), std::string::npos)
      << replay.run().err;
}

TEST(Faults, OneOfTwoLidarsMayFailAndReturn) {
  const TemporaryFolder folder;
  write_room_drive(folder.path(), seconds{6}, 2);
  const auto whole = Replay({folder.path().string()}).trajectory();
  for (const std::string fault : {"front:lost@2-4", "rear:lost@2-4", "front:lost@0", "rear:lost@0"}) {
    const Replay replay({folder.path().string(), "--fail", fault});
    ASSERT_EQ(replay.run().status, 0);
    EXPECT_EQ(replay.run().err, "") << "the fault was requested";
    EXPECT_EQ(replay.summary()["sweeps"]["failed"], 0) << fault;
    const auto path = replay.trajectory();
    ASSERT_NEAR(static_cast<double>(path.size()), static_cast<double>(whole.size()), 2);
    const auto travelled_m = [](const std::vector<StampedPose>& of) { return of.back().T_source_base.translation; };
    EXPECT_LT((travelled_m(path) - travelled_m(whole)).norm(), 0.02) << fault;
  }
}

} // namespace
} // namespace locus::test
