// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <bit>
#include <cstdint>

namespace locus::sim {

/// Chance for every single ray, of which there are 300 000 a second: a few nanoseconds a number, and the same numbers
/// with every standard library. SplitMix64 (Steele, Lea and Flood, 2014). One owner.
class QuickDice {
 public:
  explicit QuickDice(std::uint64_t seed) : state_(seed) {}

  /// 0 .. 1, 1 left out.
  double uniform() { return static_cast<double>(bits() >> 11) * 0x1p-53; }

  /// Of mean 0 and variance 1: the heads of 64 tossed coins, and two more numbers that fill the steps between whole
  /// ones. They fall as a normal distribution does to within a thousandth.
  double normal() {
    constexpr double kCoins = 64, kSigma = 4.020779361; // sqrt(64 / 4 + 2 / 12)
    const int heads = std::popcount(bits());
    const std::uint64_t more = bits();
    const double between = static_cast<double>((more >> 32U) + (more & 0xFFFF'FFFFU)) * 0x1p-32 - 1;
    return (heads - kCoins / 2 + between) / kSigma;
  }

 private:
  std::uint64_t bits() {
    state_ += 0x9E37'79B9'7F4A'7C15U;
    std::uint64_t z = state_;
    z = (z ^ (z >> 30U)) * 0xBF58'476D'1CE4'E5B9U;
    z = (z ^ (z >> 27U)) * 0x94D0'49BB'1331'11EBU;
    return z ^ (z >> 31U);
  }

  std::uint64_t state_;
};

} // namespace locus::sim
