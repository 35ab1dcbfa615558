// SPDX-License-Identifier: Apache-2.0
// A simulated day of the service in minutes. Longer runs by hand: SIMULATED_HOURS=24 SEED=7 simulated_time_tests
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include "simulated_time/simulated_day.hpp"
#include "support/temporary_folder.hpp"

namespace locus::test {
namespace {

double number(const char* variable, double otherwise) {
  const char* const text = std::getenv(variable); // NOLINT(concurrency-mt-unsafe)
  return text == nullptr ? otherwise : std::stod(text);
}

TEST(FaultSchedule, SeedDeterminesTheFaults) {
  const auto text = [](std::uint64_t seed) {
    std::string all;
    for (const ScheduledFault& fault : schedule_faults(seed, std::chrono::hours{24}, std::chrono::seconds{30}))
      all += to_text(fault) + '\n';
    return all;
  };
  EXPECT_EQ(text(7), text(7));
  EXPECT_NE(text(7), text(8));
  for (std::size_t kind = 0; kind < kDayFaults; ++kind)
    EXPECT_NE(text(7).find(to_string(static_cast<DayFault>(kind))), std::string::npos) << kind;
}

/// The default seed covers 16 of the 17 kinds of fault, including a crash, and a silence in which packets are balanced.
TEST(SimulatedDay, ServiceSurvivesItsFaults) {
  constexpr double kMostDisturbed = 0.5;
  constexpr double kSweeps_hz = 10, kLeastHeard = 0.3; // lidar, service and link are down for part of the day
  std::optional<RobotComputer> computer;
  try {
    computer.emplace();
  } catch (const std::exception& error) {
    GTEST_SKIP() << error.what();
  }
  DayOptions options;
  options.seed = static_cast<std::uint64_t>(number("SEED", 321));
  options.lasts = from_seconds(3600 * number("SIMULATED_HOURS", 0.08));
  options.mean_pause = from_seconds(number("MEAN_PAUSE", 10));
  options.course_folder = SIMULATED_DAY_COURSE;
  SimulatedDay day(options, *computer);
  day.run();
  fmt::print("{}\n", day.summary());
  EXPECT_TRUE(day.findings().empty()) << fmt::format("{}", fmt::join(day.findings(), "\n"));
  EXPECT_GT(static_cast<double>(day.estimates_heard()), kLeastHeard * kSweeps_hz * to_seconds(options.lasts));
  EXPECT_GT(day.lives(), 1);
  EXPECT_GT(day.balances(), 0U);
  if (day.disturbed_share() > kMostDisturbed)
    GTEST_SKIP() << "this machine is too slow for that rate: " << day.summary();
}

} // namespace
} // namespace locus::test

int main(int argc, char** argv) { // NOLINT(bugprone-exception-escape): then it ends, and says why
  std::setvbuf(stdout, nullptr, _IOLBF, BUFSIZ);
  const rlimit none{0, 0};
  setrlimit(RLIMIT_CORE, &none);
  locus::test::run_in_simulated_time(argv, locus::test::number("RATE", 3));
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
