// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "config/config.hpp"
#include "core/base/expected.hpp"
#include "core/odometry/odometry.hpp"
#include "daemon/sweep_processor.hpp"

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

} // namespace locus::daemon
