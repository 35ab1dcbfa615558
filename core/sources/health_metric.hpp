// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <string_view>
#include <vector>

#include "core/base/options.hpp"
#include "core/sources/motion_sample.hpp"
#include "core/sources/registration_feedback.hpp"
#include "core/sources/source_health.hpp"

namespace locus {

/// A sample of a motion source as health metrics see it: stamped by the host's clock, of one kind or the other.
struct SourceReading {
  Stamp stamp;
  Stamp arrival;
  const ImuSample* imu = nullptr;
  const OdometrySample* odometry = nullptr;
};

/// One way to tell that a motion source is not to be trusted (paper II-B.1). To add another, derive it and name it in
/// health_metrics(). A metric knows the samples and what lidar says, and no clock. One owner.
class HealthMetric {
 public:
  virtual ~HealthMetric() = default;

  /// Why this sample must be left out; nothing if there is no reason.
  virtual std::optional<HealthReason> judge(const SourceReading&) { return std::nullopt; }

  /// No metric has objected to the sample: later ones follow from it.
  virtual void accept(const SourceReading&) {}

  /// Why the source must not be used any longer, after `opinion` of lidar on it; nothing if there is no reason.
  virtual std::optional<HealthReason> hear(LidarOpinion /*opinion*/, const RegistrationFeedback&) {
    return std::nullopt;
  }

  /// What the metric has found out about the source as a whole, in words for the user; empty if nothing is wrong.
  [[nodiscard]] virtual std::string_view verdict() const { return {}; }

  /// Whether the specific force of an inertial source may be used.
  [[nodiscard]] virtual bool trusts_accelerometer() const { return true; }

  /// The source has lost its health: what comes next need not follow from what came before.
  virtual void forget() {}
};

/// All metrics for a source, in the order in which they are asked.
std::vector<std::unique_ptr<HealthMetric>> health_metrics(const MotionSourceOptions& source,
                                                          const MotionLimits& limits);

} // namespace locus
