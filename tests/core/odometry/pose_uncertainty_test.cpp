// SPDX-License-Identifier: Apache-2.0
#include "core/odometry/pose_uncertainty.hpp"

#include <gtest/gtest.h>

namespace locus {
namespace {

const Eigen::Vector3d kStep_m{0.1, 0.0, 0.0};
const Matrix6 kNoise = 1e-4 * Matrix6::Identity(); ///< 1 cm, 10 mrad
const Vector6 kNoBias = Vector6::Zero();
const Matrix6 kWholly = Matrix6::Identity();

Matrix6 sees_all_but_x() {
  Matrix6 information = 1e10 * Matrix6::Identity();
  information(0, 0) = 0.0;
  return information;
}

TEST(PoseUncertainty, NoiseAddsUpAsARandomWalkAndBiasInAStraightLine) {
  PoseUncertainty noisy, biased;
  const Vector6 bias = Vector6::Constant(0.01);
  for (int i = 0; i < 100; ++i) {
    noisy.predict(Eigen::Vector3d::Zero(), kNoise, kNoBias);
    biased.predict(Eigen::Vector3d::Zero(), Matrix6::Zero(), bias);
  }
  EXPECT_NEAR(noisy.since_start()(0, 0), 100 * 1e-4, 1e-9);
  EXPECT_NEAR(biased.since_start()(0, 0), 1.0, 1e-9);
}

TEST(PoseUncertainty, LidarTakesAwayWhatItSees) {
  PoseUncertainty uncertainty;
  uncertainty.predict(kStep_m, kNoise, Vector6::Constant(0.02));
  uncertainty.see(1e8 * Matrix6::Identity());
  EXPECT_LT(uncertainty.against_submap().norm(), 3e-8);
}

TEST(PoseUncertainty, GrowsAlongTheAxisThatLidarDoesNotSeeAndAcrossItNot) {
  PoseUncertainty uncertainty;
  for (int sweep = 0; sweep < 1000; ++sweep) {
    uncertainty.predict(kStep_m, kNoise, kNoBias);
    uncertainty.see(sees_all_but_x());
    if (sweep % 10 == 0)
      uncertainty.keep(kWholly);
  }
  EXPECT_NEAR(uncertainty.since_start()(0, 0), 1000 * 1e-4, 1e-3);
  EXPECT_LT(uncertainty.since_start()(2, 2), 1e-4);
}

TEST(PoseUncertainty, WhereNothingIsNewASweepIsOneOfManyAndTheMapHardlyMoves) {
  const auto after = [](int sweeps, double share) {
    PoseUncertainty uncertainty;
    for (int sweep = 0; sweep < sweeps; ++sweep) {
      uncertainty.predict(Eigen::Vector3d::Zero(), kNoise, kNoBias);
      uncertainty.see(1e6 * Matrix6::Identity());
      if (sweep % 10 == 9)
        uncertainty.keep(share * Matrix6::Identity());
    }
    return uncertainty.since_start()(2, 2);
  };
  EXPECT_GT(after(1000, 1.0), 5 * after(100, 1.0));
  EXPECT_LT(after(1000, 0.05), 2 * after(100, 0.05));
}

TEST(PoseUncertainty, ATurnThatIsInDoubtMovesWhatLiesAhead) {
  PoseUncertainty uncertainty;
  Matrix6 yaw_in_doubt = Matrix6::Zero();
  yaw_in_doubt(5, 5) = 0.01 * 0.01;
  uncertainty.predict(Eigen::Vector3d::Zero(), yaw_in_doubt, kNoBias);
  uncertainty.keep(kWholly);
  uncertainty.predict({10.0, 0.0, 0.0}, Matrix6::Zero(), kNoBias);
  EXPECT_NEAR(uncertainty.since_start()(1, 1), 0.1 * 0.1, 1e-9) << "10 m ahead times 10 mrad";
  EXPECT_NEAR(uncertainty.since_start()(0, 0), 0.0, 1e-9);
}

TEST(PoseUncertainty, WhatTheMapHasTakenStays) {
  PoseUncertainty uncertainty;
  uncertainty.predict(kStep_m, kNoise, kNoBias);
  uncertainty.keep(kWholly);
  EXPECT_TRUE(uncertainty.against_submap().isZero());
  uncertainty.predict(kStep_m, kNoise, kNoBias);
  uncertainty.see(1e8 * Matrix6::Identity());
  EXPECT_GT(uncertainty.since_start()(2, 2), 0.99e-4);
}

} // namespace
} // namespace locus
