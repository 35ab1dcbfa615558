// SPDX-License-Identifier: Apache-2.0
#include "daemon/service/log.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <string>
#include <thread>
#include <vector>

#include "replay/replay_run.hpp"

namespace locus::daemon {
namespace {

TEST(Log, OnePlaceThatSaysTooMuchIsSilencedAndNoOther) {
  testing::internal::CaptureStderr();
  Log log;
  for (int i = 0; i < 100; ++i)
    log.warn("the same again");
  log.error("something else");
  const std::vector<std::string> lines = test::lines_of(testing::internal::GetCapturedStderr());
  ASSERT_EQ(lines.size(), static_cast<std::size_t>(Log::kBurst) + 1);
  EXPECT_EQ(lines.front(), "locusd: warning: the same again");
  EXPECT_EQ(lines.back(), "locusd: error: something else");
}

TEST(Log, PlaceThatMaySpeakAgainTellsHowMuchWasLeftOut) {
  testing::internal::CaptureStderr();
  Log log{std::chrono::milliseconds{50}};
  const auto say = [&log] { log.warn("the same again"); };
  for (int i = 0; i < Log::kBurst + 3; ++i)
    say();
  std::this_thread::sleep_for(std::chrono::milliseconds{60});
  say();
  say();
  const std::vector<std::string> lines = test::lines_of(testing::internal::GetCapturedStderr());
  ASSERT_EQ(lines.size(), static_cast<std::size_t>(Log::kBurst) + 2);
  EXPECT_EQ(lines[Log::kBurst], "locusd: warning: the same again (3 more like it were left out)");
  EXPECT_EQ(lines.back(), "locusd: warning: the same again");
}

} // namespace
} // namespace locus::daemon
