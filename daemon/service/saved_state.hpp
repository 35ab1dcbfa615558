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

/// Tells one list of motion sources from another, in which a source may stand at another place.
struct SourceIds {
  std::uint64_t list = 0;                              ///< of names, kinds and topics, in their order
  std::array<std::uint64_t, kMaxSources> configured{}; ///< of each: what is configured of its calibration

  bool operator==(const SourceIds&) const = default;
};
SourceIds ids_of(std::span<const MotionSource> sources);

/// What a service must know to go on where another one ended: where the robot is, and what is to be seen from there.
struct SavedState {
  Whereabouts last;
  FlatGround flat_ground = FlatGround::off;
  std::vector<SurfacePoint> map_odom;
  SourceIds sources{};   ///< of those that `last` speaks of
  bool is_recent = true; ///< the robot is still there; otherwise nothing is to be gone on from but what was learned

  /// Forgets what it says of sources that are now others, and what was learned of those that are now configured
  /// otherwise.
  void forget_changed(const SourceIds& now);
};

/// The map as it is after an estimate: the surfaces within sight of where the robot is.
void read_map(const Odometry& odometry, const Pose& T_odom_base, std::vector<SurfacePoint>& map_odom);

/// To a file and back, all or nothing: it is written beside the old one, which it then replaces; when read it is
/// checked by length and checksum. Both fail with one line for the user.
std::optional<std::string> write_state(const std::filesystem::path& file, const SavedState& state);
Expected<SavedState, std::string> load_state(const std::filesystem::path& file);

/// In a file that holds the map of the same odom frame; while it is written, what it said before still counts. It does
/// not wait for the disk: a crash of the machine may cost the last ones, but never the map. Whether it fails shows with
/// the next state.
void update_whereabouts(const std::filesystem::path& file, const Whereabouts& last);

/// $STATE_DIRECTORY/state as systemd sets it; nothing without, and then no state is kept.
std::optional<std::filesystem::path> state_path();

/// Writes the state now and then, and the whereabouts as they are by then, from a thread that may wait for the disk.
/// The map is worth its cost once in many metres; who crashed while driving is elsewhere a second later.
class StateKeeper {
 public:
  static constexpr Duration kEvery = std::chrono::seconds{30};
  static constexpr double kEvery_m = 10.0;
  using Complain = std::function<void(const std::string&)>;

  /// Without a file it does nothing.
  StateKeeper(std::optional<std::filesystem::path> file, std::span<const MotionSource> sources, Complain complain)
      : file_(std::move(file)), sources_(ids_of(sources)), complain_(std::move(complain)) {}

  /// Producer, one thread: after every estimate.
  void take(const Odometry& odometry, const OdometryEstimate& estimate, FlatGround flat_ground);

  /// Producer: nothing before the first estimate.
  [[nodiscard]] const std::optional<Whereabouts>& now() const { return now_; }

  /// Thread of the disk, again and again: writes what was taken last.
  void write();

  /// Producer, while nobody writes: what was written is no longer true. When this returns the file says what is to be
  /// gone on from until the next estimate, or there is none. Waits for the disk.
  void begin_anew(const std::optional<SavedState>& start);

 private:
  struct Due {
    std::uint64_t number = 0;
    SavedState state;
  };
  /// Of the same odom frame as the state with that number.
  struct Update {
    std::uint64_t number = 0;
    Whereabouts last;
  };

  [[nodiscard]] bool is_due() const;

  std::optional<std::filesystem::path> file_;
  SourceIds sources_;
  Complain complain_;
  LatestSlot<Due> states_;
  LatestSlot<Update> whereabouts_;
  std::optional<Whereabouts> now_, saved_; ///< after the last estimate, and of the state taken last; of the producer
  std::uint64_t number_ = 0;               ///< of the state handed over last; of the producer
  std::optional<std::uint64_t> written_;   ///< number of the state that lies in the file; of the thread of the disk
};

} // namespace locus::daemon
