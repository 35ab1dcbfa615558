// SPDX-License-Identifier: Apache-2.0
#include "daemon/service/log.hpp"

#include <gtest/gtest.h>

#include <string>

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

} // namespace
} // namespace locus::daemon
