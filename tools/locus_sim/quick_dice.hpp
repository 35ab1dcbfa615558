// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <bit>
#include <cstdint>

namespace locus::sim {

/// Random numbers per ray, 300 000 a second: a few nanoseconds each, identical with every standard library. SplitMix64
/// (Steele, Lea and Flood, 2014). One owner.
class QuickDice {
 public:
  explicit QuickDice(std::uint64_t seed) : state_(seed) {}

  /// Returns a number in [0, 1).
  double uniform() { return static_cast<double>(bits() >> 11) * 0x1p-53; }

  /// Returns a number of mean 0 and variance 1: heads of 64 coin tosses, plus two uniform numbers that fill the steps
  /// between integers. The distribution is normal to within a thousandth.
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
