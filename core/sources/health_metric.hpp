// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "core/base/options.hpp"
#include "core/sources/motion_sample.hpp"
#include "core/sources/registration_feedback.hpp"
#include "core/sources/source_health.hpp"

namespace locus {

/// Sample of a motion source, as input to health metrics: stamped by the host's clock, of one kind or the other.
struct SourceReading {
  Stamp stamp;
  Stamp arrival;
  const ImuSample* imu = nullptr;
  const OdometrySample* odometry = nullptr;
};

/// Criterion for distrusting a motion source (paper II-B.1). To add another, derive from it and list it in
/// health_metrics(). A metric receives the samples and lidar's opinion, and reads no clock. One owner.
class HealthMetric {
 public:
  virtual ~HealthMetric() = default;

  /// Returns the reason to reject a sample; nothing if there is none.
  virtual std::optional<HealthReason> judge(const SourceReading&) { return std::nullopt; }

  /// Accepts a sample that no metric has rejected: a reference for later ones.
  virtual void accept(const SourceReading&) {}

  /// Returns the reason to stop using the source, given lidar's `opinion` on it; nothing if there is none.
  virtual std::optional<HealthReason> on_feedback(LidarOpinion /*opinion*/, const RegistrationFeedback&) {
    return std::nullopt;
  }

  /// Returns the finding about the source as a whole, in words for the user; empty if nothing is wrong.
  [[nodiscard]] virtual std::string_view verdict() const { return {}; }

  /// Returns whether the specific force of an inertial source may be used.
  [[nodiscard]] virtual bool trusts_accelerometer() const { return true; }

  /// Returns the matrix that maps the turns of a gyro with wrong axes to those of the base, if it is known. Its
  /// determinant is -1 if no mounting explains them.
  [[nodiscard]] virtual std::optional<Eigen::Matrix3d> gyro_axes() const { return std::nullopt; }

  /// Handles a loss of health: later samples need not be continuous with earlier ones.
  virtual void reset() {}
};

/// Returns all metrics for a source, in the order of their calls.
std::vector<std::unique_ptr<HealthMetric>> health_metrics(const MotionSourceOptions& source,
                                                          const MotionLimits& limits);

} // namespace locus
