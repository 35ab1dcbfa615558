// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <random>

namespace locus::sim {

/// Uniform numbers that are the same with every standard library. One owner.
class Dice {
 public:
  explicit Dice(std::uint64_t seed) : engine_(seed) {}

  double between(double low, double high) {
    return low + (high - low) * static_cast<double>(engine_() >> 11) * 0x1p-53;
  }
  bool chance(double probability) { return between(0, 1) < probability; }
  std::size_t below(std::size_t count) { return static_cast<std::size_t>(between(0, static_cast<double>(count))); }
  std::uint8_t brightness(int low, int high) { return static_cast<std::uint8_t>(between(low, high)); }

 private:
  std::mt19937_64 engine_;
};

} // namespace locus::sim
