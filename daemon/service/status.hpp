// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <bitset>
#include <cstddef>
#include <cstdint>
#include <ctime>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "config/config.hpp"
#include "daemon/figures.hpp"
#include "daemon/machine_time.hpp"
#include "daemon/service/log.hpp"
#include "daemon/service/session.hpp"
#include "drivers/net/udp_socket.hpp"

/// Reports of a running service to its administrator and to systemd, besides to_json(), to_text() and diagnostics().
/// Figures are live ones.
namespace locus::daemon {

/// Returns the status in one line, for systemctl status.
std::string status_line(const Figures& figures);

/// Monitors a session a few times a second and logs problems: silent sensors, a missing network, packets dropped by the
/// kernel, an overloaded computer, a failing recording. Logs each once per change for the worse or the better. One
/// owner.
class SessionMonitor {
 public:
  /// Silence of a sensor before it is reported; also the period of some checks.
  static constexpr Duration kPatience = std::chrono::seconds{5};

  using Clock = Duration (*)(clockid_t); ///< read_clock(), replaceable in tests
  /// Monitors a session with this configuration and these lidar sockets.
  SessionMonitor(
      const Config& config, std::span<const UdpSocket> sockets, Log& log,
      Clock clock = [](clockid_t id) { return read_clock(id); })
      : config_(config), sockets_(sockets), log_(log), clock_(clock) {}

  /// Checks the figures of that session.
  void check(const Figures& figures);

 private:
  void check_link(const LinkFigures& link);
  void check_sources(const LinkFigures& link);
  void check_lidars(const Figures& figures);
  void check_verdicts(const IngestReport& ingest);
  void check_calibration(const Figures& figures);
  void check_speed(double largest_mps);
  void check_load(const SweepCounters& counters);
  void check_drops(const Figures::Live& live);
  void check_publishers(const LinkFigures& link);
  void check_recording(const Recorder::Status& recording);

  /// Kind of reason for the silence of a lidar.
  enum class Silence : std::uint8_t { nothing_arrives, other_sender, positions_only, rejected, count };

  /// Last known state of a lidar.
  struct Lidar {
    std::uint64_t data = 0, received = 0; ///< counters at the last usable data
    Duration last_data{};                 ///< time of the last usable data, or start of the wait for it
    /// Reasons logged in the present silence, each once: other senders take turns.
    std::bitset<static_cast<std::size_t>(Silence::count)> logged_silence;
    bool short_sweep_logged = false;
    bool shared_port_logged = false;
    CloudDoubts logged_doubts{};
    std::string logged_unused_pps; ///< logged reason why its locked PPS is not used
  };
  void check_doubts(Lidar& lidar, const LidarOptions& options, const IngestReport::Lidar& now);
  static std::pair<Silence, std::string> why_silent(const Lidar& lidar, const LidarOptions& options,
                                                    const IngestReport::Lidar& now);

  const Config& config_;
  std::span<const UdpSocket> sockets_;
  Log& log_;
  Clock clock_;
  bool was_connected_ = false;
  std::uint64_t logged_attempts_ = 0;
  std::array<Lidar, kMaxLidars> lidars_;
  bool speed_logged_ = false, mounting_logged_ = false;
  std::bitset<kMaxSources> slow_imus_logged_;
  std::array<std::string_view, kMaxSources> logged_verdicts_; ///< last logged verdicts
  std::bitset<kMaxSources> miscalibrated_;                    ///< sources with a logged calibration error
  std::set<std::string> silent_sources_;                      ///< sources logged as silent
  std::set<std::string> contested_topics_;                    ///< topics logged for rejected messages
  std::uint64_t kernel_drops_ = 0, filtered_ = 0, sweep_drops_ = 0;
  Recorder::Status recording_; ///< last logged status
  Duration joined_at_{}, load_checked_at_{};
};

/// Feeds systemd's watchdog while all threads make progress, and so detects a hung thread. One owner.
class Watchdog {
 public:
  /// Enables the watchdog if systemd requests it (WatchdogSec=).
  Watchdog();
  void feed(const Session& session);

 private:
  Duration period_{}; ///< zero: disabled
  Duration fed_at_{};
  std::optional<Session::Progress> last_;
};

} // namespace locus::daemon
