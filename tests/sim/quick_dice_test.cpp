// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/quick_dice.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace locus::sim {
namespace {

constexpr int kDraws = 1'000'000;

/// Returns the Kolmogorov distance between the sample and its nominal distribution.
template <class Distribution> double kolmogorov(std::vector<double> sample, Distribution distribution) {
  std::sort(sample.begin(), sample.end());
  double largest = 0;
  for (std::size_t i = 0; i < sample.size(); ++i)
    largest = std::max(largest, std::abs(distribution(sample[i]) - static_cast<double>(i) / kDraws));
  return largest;
}

TEST(QuickDice, UniformNumbersHaveTheirMoments) {
  QuickDice dice(7);
  std::vector<double> sample(kDraws);
  std::generate(sample.begin(), sample.end(), [&] { return dice.uniform(); });
  EXPECT_LT(kolmogorov(sample, [](double x) { return std::clamp(x, 0.0, 1.0); }), 0.002);
}

TEST(QuickDice, NormalNumbersHaveTheirDistributionWithinAThousandth) {
  QuickDice dice(7);
  std::vector<double> sample(kDraws);
  std::generate(sample.begin(), sample.end(), [&] { return dice.normal(); });
  double sum = 0, squares = 0;
  for (const double x : sample) {
    sum += x;
    squares += x * x;
  }
  EXPECT_NEAR(sum / kDraws, 0, 0.004);
  EXPECT_NEAR(squares / kDraws, 1, 0.006);
  EXPECT_LT(kolmogorov(sample, [](double x) { return 0.5 * std::erfc(-x / std::sqrt(2.0)); }), 0.002);
}

TEST(QuickDice, NumbersDependOnTheSeed) {
  QuickDice one(1), same(1), other(2);
  const double first = one.uniform();
  EXPECT_EQ(first, same.uniform());
  EXPECT_NE(first, other.uniform());
}

} // namespace
} // namespace locus::sim
