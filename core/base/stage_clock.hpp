// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "core/base/names.hpp"

namespace locus {

/// Stages whose cost is reported.
enum class Stage : std::uint8_t { decode, correct, filter, covariance, scan_to_scan, scan_to_submap, map };
constexpr auto names_of(Stage) {
  return std::to_array<std::string_view>(
      {"decode", "correct", "filter", "covariance", "scan_to_scan", "scan_to_submap", "map"});
}
inline constexpr std::size_t kStages = names_of(Stage{}).size();

/// Interface notified when a stage begins and ends. The core reads no clock; a caller that wants timing supplies one.
class StageClock {
 public:
  virtual ~StageClock() = default;
  virtual void enter(Stage stage) = 0;
  virtual void leave() = 0; ///< ends the innermost stage
};

/// Marks a stage for the lifetime of the object; does nothing without a clock.
class StageScope {
 public:
  StageScope(StageClock* clock, Stage stage) : clock_(clock) {
    if (clock_ != nullptr)
      clock_->enter(stage);
  }
  ~StageScope() {
    if (clock_ != nullptr)
      clock_->leave();
  }
  StageScope(const StageScope&) = delete;
  StageScope& operator=(const StageScope&) = delete;

 private:
  StageClock* clock_;
};

} // namespace locus
