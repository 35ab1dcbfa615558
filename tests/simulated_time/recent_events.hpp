// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <initializer_list>
#include <map>
#include <string>
#include <vector>

#include "core/base/stamp.hpp"
#include "simulated_time/fault_schedule.hpp"

namespace locus::test {

/// Events of the day so far, and the violations found. All times are simulated ones since the start. Not thread-safe.
class Events {
 public:
  void set_now(Duration now);
  [[nodiscard]] Duration now() const { return now_; }

  void begin(DayFault kind);
  void end(DayFault kind);
  [[nodiscard]] bool is_on(DayFault kind) const { return of(kind).active; }
  /// Returns the time since its end; zero while it lasts, very long if it never occurred.
  [[nodiscard]] Duration since_end(DayFault kind) const;
  /// Returns whether one of them is active, or was within this time.
  [[nodiscard]] bool any(std::initializer_list<DayFault> kinds, Duration within) const;

  /// Registers that this machine was too slow: for a while no finding counts against the service.
  void disturb(const std::string& why);
  [[nodiscard]] bool is_disturbed() const { return now_ < disturbed_until_; }
  [[nodiscard]] double disturbed_share() const { return to_seconds(disturbed_) / to_seconds(now_); }

  /// Registers a violation, the first few of a kind; ignored while this machine is too slow.
  void find(const std::string& what);
  [[nodiscard]] const std::vector<std::string>& findings() const { return findings_; }

 private:
  struct Kind {
    bool active = false;
    Duration ended = -std::chrono::hours{1000};
  };
  [[nodiscard]] const Kind& of(DayFault kind) const { return kinds_[static_cast<std::size_t>(kind)]; }

  Duration now_{}, disturbed_until_{}, disturbed_{};
  std::array<Kind, kDayFaults> kinds_{};
  std::vector<std::string> findings_;
  std::map<std::string, int> found_; ///< by kind
};

} // namespace locus::test
