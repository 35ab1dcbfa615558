// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

#include "core/base/stamp.hpp"
#include "drivers/ouster/metadata.hpp"
#include "locus_sim/synthetic_lidar.hpp"

namespace locus::sim {

/// One Ouster as the simulator has it: RNG19, a single return, 1024 columns at 10 Hz, its time from the internal
/// oscillator. What is written of it and what is cast come from the same text. Immutable.
class OusterSensor {
 public:
  /// Precondition: the model of the options is an OusterModel. `start`: of the trajectory; the sensor was switched on
  /// some time before.
  OusterSensor(const SyntheticLidarOptions& options, Stamp start);

  [[nodiscard]] const std::string& metadata_text() const { return text_; } ///< JSON, as the sensor serves it
  [[nodiscard]] const ouster::Metadata& metadata() const { return metadata_; }

  /// What its clock shows when the lidar's own time (SyntheticLidar) is this. Precondition: not long before the start.
  [[nodiscard]] Duration shown_at(Stamp own_time) const { return own_time - switched_on_; }
  /// The same at a true instant.
  [[nodiscard]] Duration shown_at_true(Stamp stamp) const;

 private:
  std::string text_;
  ouster::Metadata metadata_;
  Stamp start_, switched_on_;
  double drift_;
};

} // namespace locus::sim
