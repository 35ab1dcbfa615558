// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/base/pose.hpp"

namespace locus {

/// What is expected of a kind of prior before anything is learned, per sweep.
struct PriorExpectation {
  Vector6 sigma;       ///< standard deviation
  Vector6 bias;        ///< the part of an error that the next sweep repeats
  Vector6 least_sigma; ///< the least ever believed
};

/// How far one kind of prior lies from what the lidar finds, axis by axis, learned from sweep to sweep.
///
/// Its inverse is the weight of the prior in the registration, so a prior is trusted as far as it has proved itself and
/// no constant is tuned to a robot. An axis is learned from only where the points constrain it: where they do not, the
/// registration repeats the prior, which proves nothing. One owner.
class PriorStatistics {
 public:
  explicit PriorStatistics(const PriorExpectation& expectation);

  /// `difference` of the registration from the prior in base axes; `lidar_information` of the registration in the same
  /// axes.
  void learn(const Vector6& difference, const Matrix6& lidar_information);

  /// Variances of the prior over `periods` sweep periods.
  [[nodiscard]] Vector6 variance(double periods) const;

  /// The part of the error that is the same from sweep to sweep, as those of scale and of gyro bias are, over
  /// `periods`: what adds up while nothing corrects it.
  [[nodiscard]] Vector6 bias(double periods) const;

 private:
  Vector6 variance_;
  Vector6 least_variance_;
  Vector6 bias_;
  Vector6 learned_ = Vector6::Zero(); ///< sweeps in which lidar saw the axis
};

} // namespace locus
