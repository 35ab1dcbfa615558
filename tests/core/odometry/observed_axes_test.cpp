// SPDX-License-Identifier: Apache-2.0
#include "core/odometry/observed_axes.hpp"

#include <gtest/gtest.h>

namespace locus {
namespace {

constexpr int kForward = 0;
constexpr int kHeading = 5;

/// All axes are well observed but one, which has `observability` and no correlation with the others.
Matrix6 weak_along(int axis, double observability) {
  Matrix6 observed = 0.3 * Matrix6::Identity();
  observed(axis, axis) = observability;
  return observed;
}

TEST(ObservedAxes, AreAllInitially) { EXPECT_TRUE(ObservedAxes{}.all()); }

TEST(ObservedAxes, HaveHysteresisFromOneToTwoHundredths) {
  ObservedAxes axes;
  const auto sees_after = [&axes](double observability) {
    const Vector6 observed = axes.observe(weak_along(kForward, observability));
    EXPECT_NEAR(observed[kForward], observability, 2e-6);
    EXPECT_TRUE(axes.each()[kHeading]);
    EXPECT_EQ(axes.all(), axes.each()[kForward]);
    return axes.all();
  };
  EXPECT_TRUE(sees_after(0.011));
  EXPECT_FALSE(sees_after(0.009));
  EXPECT_FALSE(sees_after(0.019)) << "once lost";
  EXPECT_TRUE(sees_after(0.021));
  EXPECT_TRUE(sees_after(0.011)) << "once seen";
}

/// A surface that constrains only a combination of rotation and translation, such as a distant wall to the side, makes
/// neither observable.
TEST(ObservedAxes, ExcludeAnAxisObservedOnlyTogetherWithAnother) {
  ObservedAxes axes;
  Matrix6 together = weak_along(kForward, 0.3);
  together(kForward, kHeading) = together(kHeading, kForward) = 0.3;
  const Vector6 observed = axes.observe(together);
  EXPECT_LT(observed[kForward], 1e-5);
  EXPECT_LT(observed[kHeading], 1e-5);
  EXPECT_FALSE(axes.each()[kForward]);
  EXPECT_FALSE(axes.each()[kHeading]);
}

TEST(ObservedAxes, ZeroObservabilityStaysFinite) {
  ObservedAxes axes;
  const Vector6 observed = axes.observe(Matrix6::Zero());
  EXPECT_TRUE(observed.allFinite());
  for (const bool axis_observed : axes.each())
    EXPECT_FALSE(axis_observed);
}

TEST(ObservedAxes, PartOfZeroesUnobservedAxes) {
  ObservedAxes axes;
  axes.observe(weak_along(kForward, 0.001));
  Vector6 left = Vector6::Ones();
  left[kForward] = 0.0;
  EXPECT_EQ(axes.part_of(Vector6::Ones()), left);
}

} // namespace
} // namespace locus
