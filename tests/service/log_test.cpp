// SPDX-License-Identifier: Apache-2.0
#include "daemon/service/log.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <sys/mount.h>
#include <sys/stat.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <string>
#include <vector>

#include "replay/replay_run.hpp"

namespace locus::daemon {
namespace {

Duration log_time = std::chrono::hours{1};

/// Simulated time, advanced by the test only.
Duration read_log_time(clockid_t /*clock*/) { return log_time; }

TEST(Log, RateLimitAppliesPerSourceLocation) {
  testing::internal::CaptureStderr();
  Log log{read_log_time};
  for (int i = 0; i < 100; ++i)
    log.warn("the same again");
  log.error("something else");
  const std::vector<std::string> lines = test::lines_of(testing::internal::GetCapturedStderr());
  ASSERT_EQ(lines.size(), static_cast<std::size_t>(Log::kBurst) + 1);
  EXPECT_EQ(lines.front(), "locusd: warning: the same again");
  EXPECT_EQ(lines.back(), "locusd: error: something else");
}

TEST(Log, NextMessageAfterSuppressionReportsTheNumber) {
  testing::internal::CaptureStderr();
  Log log{read_log_time};
  const auto say = [&log] { log.warn("the same again"); };
  for (int i = 0; i < Log::kBurst + 2; ++i)
    say();
  log_time += Log::kInterval;
  say(); // not yet
  log_time += Duration{1};
  say();
  say();
  const std::vector<std::string> lines = test::lines_of(testing::internal::GetCapturedStderr());
  ASSERT_EQ(lines.size(), static_cast<std::size_t>(Log::kBurst) + 2);
  EXPECT_EQ(lines[Log::kBurst], "locusd: warning: the same again (3 more like it were suppressed)");
  EXPECT_EQ(lines.back(), "locusd: warning: the same again");
}

/// As in a container that inherits the variable of the journal, but not its socket.
TEST(Log, GoesToStderrWhereThereIsNoJournal) {
  const bool has_journal = access("/run/systemd", F_OK) == 0;
  if (has_journal && (unshare(CLONE_NEWNS) != 0 || mount("none", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) != 0 ||
                      mount("tmpfs", "/run/systemd", "tmpfs", 0, nullptr) != 0))
    GTEST_SKIP() << "cannot hide the journal: run as root";
  testing::internal::CaptureStderr();
  struct stat stream {};
  ASSERT_EQ(fstat(STDERR_FILENO, &stream), 0);
  // NOLINTNEXTLINE(concurrency-mt-unsafe)
  setenv("JOURNAL_STREAM", fmt::format("{}:{}", stream.st_dev, stream.st_ino).c_str(), 1);
  Log{read_log_time}.warn("said");
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "locusd: warning: said\n");
  unsetenv("JOURNAL_STREAM"); // NOLINT(concurrency-mt-unsafe)
  if (has_journal)
    umount2("/run/systemd", MNT_DETACH);
}

} // namespace
} // namespace locus::daemon
