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

/// Drives lap after lap through the live threads and measures each as a piece. Not thread-safe.
///
/// Faults follow a cycle of six laps. In the first half of the day the threads keep running; in the second they are
/// restarted on each lap, cleanly and by a crash in alternation, while the robot drives and while it stands.
class Soak {
 public:
  /// `folder` holds the saved state; resumes after `laps_done` of `laps`. Throws tools::Failure.
  Soak(const ClosedCourse& course, const std::filesystem::path& folder, std::uint64_t laps_done, std::uint64_t laps);

  /// Drives the next lap.
  Piece drive_lap();

 private:
  void take(const daemon::ProcessedSweep& done);
  [[nodiscard]] Duration time_of_restart() const; ///< within the lap
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
  Duration lap_begin_{}; ///< start of the lap relative to that of the first one

  std::vector<StampedPose> estimates_; ///< of this lap, with the times of the first one
  std::vector<double> cpu_ms_, latency_ms_;
};

} // namespace locus::soak
