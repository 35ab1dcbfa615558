// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "config/config.hpp"
#include "core/odometry/odometry.hpp"
#include "daemon/service/saved_state.hpp"
#include "daemon/threads.hpp"

namespace locus::daemon {

/// Saves the full state periodically and the resume state more often, from a thread that may block on the disk: the map
/// is worth its cost only every kPeriod or kDistance_m, but the pose of a moving robot is outdated within a second.
class StateSaver {
 public:
  static constexpr Duration kPeriod = std::chrono::seconds{30};
  static constexpr double kDistance_m = 10.0;
  using ErrorSink = std::function<void(const std::string&)>;

  /// Does nothing if `file` is empty.
  StateSaver(std::optional<std::filesystem::path> file, std::span<const MotionSource> sources, ErrorSink error_sink)
      : file_(std::move(file)), sources_(ids_of(sources)), error_sink_(std::move(error_sink)) {}

  /// Producer, one thread: hands over the state after every estimate.
  void update(const Odometry& odometry, const OdometryEstimate& estimate, FlatGround flat_ground);

  /// Producer: returns the current resume state; empty before the first estimate.
  [[nodiscard]] const std::optional<ResumeState>& last() const { return last_; }

  /// Disk thread, periodically: writes the latest state or resume state. Reports a failure once, until it succeeds.
  void write();

  /// Producer: replaces the saved state by `start`, or removes it. Blocks on the disk; precondition: write() is not
  /// running.
  void reset(const std::optional<SavedState>& start);

 private:
  struct PendingState {
    std::uint64_t number = 0;
    SavedState state;
  };
  /// ResumeState in the odom frame of the state with this number.
  struct PendingUpdate {
    std::uint64_t number = 0;
    ResumeState last;
  };

  [[nodiscard]] bool is_due() const;

  std::optional<std::filesystem::path> file_;
  SourceIds sources_;
  ErrorSink error_sink_;
  LatestSlot<PendingState> states_;
  LatestSlot<PendingUpdate> resume_state_;
  std::optional<ResumeState> last_, saved_; ///< after the last estimate; in the last state; owned by the producer
  std::uint64_t number_ = 0;                ///< number of the last state handed over; owned by the producer
  std::optional<std::uint64_t> written_;    ///< number of the state in the file; owned by the disk thread
  bool has_failed_ = false;                 ///< latest attempt; owned by the disk thread
};

} // namespace locus::daemon
