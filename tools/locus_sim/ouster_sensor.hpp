// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

#include "core/base/stamp.hpp"
#include "drivers/ouster/metadata.hpp"
#include "locus_sim/synthetic_lidar.hpp"

namespace locus::sim {

/// Simulated Ouster: RNG19, a single return, 1024 columns at 10 Hz, time from the internal oscillator. Metadata and
/// beams come from the same text. Immutable.
class OusterSensor {
 public:
  /// Precondition: the model of the options is an OusterModel. `start`: start of the trajectory, some time after
  /// switch-on.
  OusterSensor(const SyntheticLidarOptions& options, Stamp start);

  [[nodiscard]] const std::string& metadata_text() const { return text_; } ///< JSON, as served by the sensor
  [[nodiscard]] const ouster::Metadata& metadata() const { return metadata_; }

  /// Converts the lidar's own time (SyntheticLidar) to the reading of its clock. Precondition: not long before the
  /// start.
  [[nodiscard]] Duration shown_at(Stamp own_time) const { return own_time - switched_on_; }
  /// Converts a true instant likewise.
  [[nodiscard]] Duration shown_at_true(Stamp stamp) const;

 private:
  std::string text_;
  ouster::Metadata metadata_;
  Stamp start_, switched_on_;
  double drift_;
};

} // namespace locus::sim
