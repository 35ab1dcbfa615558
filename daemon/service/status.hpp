// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <bitset>
#include <cstdint>
#include <ctime>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>

#include "config/config.hpp"
#include "daemon/figures.hpp"
#include "daemon/machine_time.hpp"
#include "daemon/service/log.hpp"
#include "daemon/service/session.hpp"
#include "drivers/net/udp_socket.hpp"

/// What a running service tells of its figures beside to_json(), to_text() and diagnostics(): to who administers it,
/// and to systemd. Figures are live ones.
namespace locus::daemon {

/// In one line of plain words, for systemctl status.
std::string status_line(const Figures& figures);

/// Looks after a session a few times a second and tells what its owner should know: sensors that are not heard, a
/// network that is not there, packets that the kernel threw away, a computer that is too busy, a disk that takes no
/// recording. Tells each once per turn for the worse or the better. One owner.
class Watch {
 public:
  /// Silence of a sensor that should have spoken by then.
  static constexpr Duration kPatience = std::chrono::seconds{5};

  using Clock = Duration (*)(clockid_t); ///< read_clock(), or another in tests
  /// Of a session: what it is configured as, and the sockets of its lidars.
  Watch(
      const Config& config, std::span<const UdpSocket> sockets, Log& log,
      Clock clock = [](clockid_t id) { return read_clock(id); })
      : config_(config), sockets_(sockets), log_(log), clock_(clock) {}

  /// At the figures of that session.
  void look(const Figures& figures);

 private:
  void look_at_link(const LinkFigures& link);
  void look_at_sources(const LinkFigures& link);
  void look_at_lidars(const Figures& figures);
  void look_at_verdicts(const IngestReport& ingest);
  void look_at_calibration(const Figures& figures);
  void look_at_speed(double largest_mps);
  void look_at_load(const SweepCounters& counters);
  void look_at_drops(const Figures::Live& live);
  void look_at_intruders(const LinkFigures& link);
  void look_at_recording(const Recorder::Status& recording);

  /// What was last seen of a lidar.
  struct Lidar {
    std::uint64_t data = 0, received = 0; ///< when it was last heard
    Duration heard{};                     ///< when that was, or since when it is waited for
    std::string told;                     ///< why it is silent, as it was told; empty: it is not
    bool short_sweep_told = false;
    bool shared_port_told = false;
    CloudDoubts doubts_told{};
  };
  void look_at_doubts(Lidar& lidar, const LidarOptions& options, const IngestReport::Lidar& now);
  static std::string why_silent(const Lidar& lidar, const LidarOptions& options, const IngestReport::Lidar& now);

  const Config& config_;
  std::span<const UdpSocket> sockets_;
  Log& log_;
  Clock clock_;
  bool was_connected_ = false;
  std::uint64_t told_attempts_ = 0;
  std::array<Lidar, kMaxLidars> lidars_;
  bool told_speed_ = false;
  std::array<std::string_view, kMaxSources> verdicts_; ///< as they were told
  std::bitset<kMaxSources> askew_;                     ///< of whose calibration was told
  std::set<std::string> unheard_;                      ///< sources that were told of
  std::set<std::string> intruded_;                     ///< topics that were told of
  std::uint64_t kernel_drops_ = 0, filtered_ = 0, sweep_drops_ = 0;
  Recorder::Status recording_; ///< as it was told
  Duration joined_{}, weighed_{};
};

/// Tells a hung thread from a quiet one: fed to systemd's watchdog only while all threads go on. One owner.
class Watchdog {
 public:
  /// Nothing to do unless systemd asks for it (WatchdogSec=).
  Watchdog();
  void look(const Session& session);

 private:
  Duration period_{}; ///< zero: nobody asks
  Duration fed_{};
  std::optional<Session::Progress> last_;
};

} // namespace locus::daemon
