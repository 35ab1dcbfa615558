// SPDX-License-Identifier: Apache-2.0
#include "daemon/latest_slot.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <thread>

namespace locus::daemon {
namespace {

TEST(LatestSlot, IsEmptyBeforeTheFirstValueAndAfterEachTake) {
  LatestSlot<int> slot;
  EXPECT_EQ(slot.take(), nullptr);
  slot.back() = 7;
  EXPECT_FALSE(slot.publish());
  const int* taken = slot.take();
  ASSERT_NE(taken, nullptr);
  EXPECT_EQ(*taken, 7);
  EXPECT_EQ(slot.take(), nullptr);
}

TEST(LatestSlot, NewestOfThreeWinsAndTheOthersAreReportedDropped) {
  LatestSlot<int> slot;
  slot.back() = 1;
  EXPECT_FALSE(slot.publish());
  slot.back() = 2;
  EXPECT_TRUE(slot.publish());
  slot.back() = 3;
  EXPECT_TRUE(slot.publish());
  const int* taken = slot.take();
  ASSERT_NE(taken, nullptr);
  EXPECT_EQ(*taken, 3);
  slot.back() = 4;
  EXPECT_FALSE(slot.publish()) << "3 was taken, nothing was dropped";
}

TEST(LatestSlot, TakenValueStaysWhileTheProducerGoesOn) {
  LatestSlot<int> slot;
  slot.back() = 1;
  ASSERT_FALSE(slot.publish());
  const int* taken = slot.take();
  ASSERT_NE(taken, nullptr);
  for (int value = 2; value < 10; ++value) {
    slot.back() = value;
    EXPECT_EQ(slot.publish(), value > 2);
    EXPECT_EQ(*taken, 1);
  }
}

/// A value that was torn has words of two values in it.
TEST(LatestSlot, ConsumerSeesWholeValuesInOrderAndEveryOneIsTakenOrDropped) {
  constexpr std::uint64_t kValues = 300'000;
  LatestSlot<std::array<std::uint64_t, 32>> slot;
  std::uint64_t dropped = 0;
  std::thread producer([&] {
    for (std::uint64_t value = 1; value <= kValues; ++value) {
      slot.back().fill(value);
      if (slot.publish())
        ++dropped;
    }
  });
  std::uint64_t taken = 0;
  std::uint64_t torn = 0;
  std::uint64_t out_of_order = 0;
  for (std::uint64_t newest = 0; newest < kValues;) {
    const auto* value = slot.take();
    if (value == nullptr)
      continue;
    ++taken;
    torn += std::count(value->begin(), value->end(), value->front()) == 32 ? 0U : 1U;
    out_of_order += value->front() > newest ? 0U : 1U;
    newest = value->front();
  }
  producer.join();
  EXPECT_EQ(torn, 0U);
  EXPECT_EQ(out_of_order, 0U);
  EXPECT_EQ(taken + dropped, kValues);
}

} // namespace
} // namespace locus::daemon
