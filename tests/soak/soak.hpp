// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "config/config.hpp"
#include "drivers/files/motion_files.hpp"
#include "looped_course.hpp"
#include "piece.hpp"
#include "restarting_pipeline.hpp"

namespace locus::soak {

/// Drives lap after lap through the live threads, one piece each, and measures them. One owner.
///
/// Each lap of six has its faults. In the first half of the day the threads live on; in the second they are restarted
/// on each lap, in order and by a crash in turn, while the robot drives and while it stands.
class Soak {
 public:
  /// `folder` holds the saved state; goes on after `laps_done` of `laps`. Throws tools::Failure.
  Soak(const ClosedCourse& course, const std::filesystem::path& folder, std::uint64_t laps_done, std::uint64_t laps);

  /// Drives the next lap.
  Piece drive_lap();

 private:
  void take(const daemon::ProcessedSweep& done);
  [[nodiscard]] Duration time_of_restart() const; ///< on this lap
  void drive_to_rest();
  void restart();
  void count_and_measure(Piece& piece);

  Duration lap_duration_;
  Config config_;
  std::vector<StampedPose> truth_; ///< of the first lap
  std::uint64_t lap_, laps_;
  std::int64_t process_ns_;
  LoopedCourse course_;
  RestartingPipeline pipeline_;
  Duration lap_begin_{}; ///< that of the lap, in time since the first one began

  std::vector<StampedPose> estimates_; ///< of this lap, as if it were the first
  std::vector<double> cpu_ms_, latency_ms_;
};

} // namespace locus::soak
