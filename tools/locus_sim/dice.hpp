// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <random>
#include <string_view>

namespace locus::sim {

/// Derives a seed for each purpose, so that purposes do not affect each other's numbers (FNV-1a).
inline std::uint64_t seed_for(std::uint64_t seed, std::string_view purpose) {
  std::uint64_t hash = 0xCBF2'9CE4'8422'2325U ^ (seed * 0x9E37'79B9'7F4A'7C15U);
  for (const char c : purpose)
    hash = (hash ^ static_cast<unsigned char>(c)) * 0x0000'0100'0000'01B3U;
  return hash;
}

/// Uniform random numbers, identical with every standard library. One owner.
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
