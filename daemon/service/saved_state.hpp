// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "config/config.hpp"
#include "core/base/expected.hpp"
#include "core/odometry/odometry.hpp"
#include "daemon/sweep_processor.hpp"
#include "daemon/threads.hpp"

namespace locus::daemon {

/// Hashes that detect a change of the list of motion sources, which may reorder them, or of their calibration.
struct SourceIds {
  std::uint64_t list = 0;                              ///< hash of names, kinds and topics, in order
  std::array<std::uint64_t, kMaxSources> configured{}; ///< by source: hash of its configured calibration

  bool operator==(const SourceIds&) const = default;
};
SourceIds ids_of(std::span<const MotionSource> sources);

/// State needed to resume where another service ended: the pose of the robot and the map around it.
struct SavedState {
  ResumeState last;
  FlatGround flat_ground = FlatGround::off;
  std::vector<SurfacePoint> map_odom;
  SourceIds sources{};   ///< motion sources that `last` refers to
  bool is_recent = true; ///< the pose is still valid; otherwise only the learned calibration is used

  /// Discards the data of motion sources if their list has changed, and the learned calibration of sources whose
  /// configuration has changed.
  void reset_changed_sources(const SourceIds& now);
};

/// Copies the surfaces of the map within sight of the robot, odom frame, after an estimate.
void read_map(const Odometry& odometry, const Pose& T_odom_base, std::vector<SurfacePoint>& map_odom);

/// Writes and reads the state atomically: a new file is written next to the old one and replaces it; reading verifies
/// the length and checksum. Both fail with one line for the user.
std::optional<std::string> write_state(const std::filesystem::path& file, const SavedState& state);
Expected<SavedState, std::string> load_state(const std::filesystem::path& file);

/// Updates pose and sources in a file that holds the map of the same odom frame; the previous entry stays valid while
/// this one is written. Does not sync: a crash of the machine may lose the last updates, but never the map. A failure
/// is reported by the next write_state().
void update_resume_state(const std::filesystem::path& file, const ResumeState& last);

/// Returns $STATE_DIRECTORY/state, with the variable set by systemd; empty without it: no state is saved then.
std::optional<std::filesystem::path> state_path();

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
