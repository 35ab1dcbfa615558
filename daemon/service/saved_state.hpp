// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "core/expected.hpp"
#include "core/odometry.hpp"
#include "daemon/latest_slot.hpp"
#include "daemon/sweep_processor.hpp"
#include "daemon/wakeup.hpp"

namespace locus::daemon {

/// What a service must know to go on where another one ended: where the robot is, and what is to be seen from there.
struct SavedState {
  Stamp stamp; ///< of the estimate
  FlatGround flat_ground = FlatGround::off;
  StartPoint start;
};

/// The state as it is after an estimate: the surfaces within sight.
void read_state(const Odometry& odometry, const OdometryEstimate& estimate, SavedState& state);

/// To a file and back, all or nothing: it is written beside the old one, which it then replaces; when read it is
/// checked by length and checksum. Both fail with one line for the user.
std::optional<std::string> write_state(const std::filesystem::path& file, const SavedState& state);
Expected<SavedState, std::string> load_state(const std::filesystem::path& file);

/// $STATE_DIRECTORY/state as systemd sets it; nothing without, and then no state is kept.
std::optional<std::filesystem::path> state_path();

/// Writes the state now and then, from a thread of its own.
class StateKeeper {
 public:
  static constexpr Duration kEvery = std::chrono::seconds{30};
  static constexpr double kEvery_m = 10.0;
  using Complain = std::function<void(const std::string&)>;

  /// Without a file it does nothing.
  StateKeeper(std::optional<std::filesystem::path> file, Complain complain);
  ~StateKeeper();
  StateKeeper(const StateKeeper&) = delete;
  StateKeeper& operator=(const StateKeeper&) = delete;

  /// Producer, one thread: after every estimate.
  void take(const Odometry& odometry, const OdometryEstimate& estimate, FlatGround flat_ground);

  /// Producer: what was written is no longer true; the next estimate is written at once.
  void begin_anew() { last_.reset(); }

 private:
  void run();

  std::optional<std::filesystem::path> file_;
  Complain complain_;
  LatestSlot<SavedState> slot_;
  std::optional<OdometryEstimate> last_; ///< that was taken; of the producer
  Wakeup wakeup_;
  std::atomic<bool> stopping_{false};
  std::thread thread_;
};

} // namespace locus::daemon
