// SPDX-License-Identifier: Apache-2.0
#include "daemon/spsc_ring.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <thread>

namespace locus::daemon {
namespace {

TEST(SpscRing, GivesBackInOrderAndIsEmptyThen) {
  SpscRing<int, 4> ring;
  EXPECT_TRUE(ring.empty());
  EXPECT_EQ(ring.pop(), std::nullopt);
  EXPECT_TRUE(ring.push(1));
  EXPECT_TRUE(ring.push(2));
  EXPECT_FALSE(ring.empty());
  EXPECT_EQ(ring.pop(), 1);
  EXPECT_EQ(ring.pop(), 2);
  EXPECT_EQ(ring.pop(), std::nullopt);
}

TEST(SpscRing, FullRingRefusesAndKeepsWhatItHas) {
  SpscRing<int, 4> ring;
  for (int round = 0; round < 3; ++round) { // the places wrap around
    for (int value = 0; value < 4; ++value)
      EXPECT_TRUE(ring.push(value));
    EXPECT_FALSE(ring.push(99));
    for (int value = 0; value < 4; ++value)
      EXPECT_EQ(ring.pop(), value);
    EXPECT_TRUE(ring.push(5));
    EXPECT_EQ(ring.pop(), 5);
  }
}

TEST(SpscRing, WhatIsPushedByOneThreadComesOutOnceWholeAndInOrderInAnother) {
  constexpr std::uint64_t kValues = 300'000;
  using Value = std::array<std::uint64_t, 4>;
  SpscRing<Value, 16> ring;
  std::thread producer([&] {
    for (std::uint64_t value = 0; value < kValues; ++value) {
      while (!ring.push(Value{value, value, value, value}))
        std::this_thread::yield();
    }
  });
  std::uint64_t wrong = 0;
  for (std::uint64_t expected = 0; expected < kValues;) {
    const std::optional<Value> value = ring.pop();
    if (!value) {
      std::this_thread::yield();
      continue;
    }
    wrong += *value == Value{expected, expected, expected, expected} ? 0U : 1U;
    ++expected;
  }
  producer.join();
  EXPECT_EQ(wrong, 0U);
  EXPECT_TRUE(ring.empty());
}

} // namespace
} // namespace locus::daemon
