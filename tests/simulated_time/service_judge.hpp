// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "simulated_time/recent_events.hpp"
#include "simulated_time/systemd_stand_in.hpp"

namespace locus::test {

/// Checks the service's reports: its counters are consistent, all datagrams are accounted for, no healthy sensor is
/// blamed, and its memory is bounded. Not thread-safe.
class ServiceJudge {
 public:
  explicit ServiceJudge(Events& events) : events_(events) {}

  /// Reads the service's stderr and the exits of its processes.
  void read(const std::vector<std::string>& lines);
  /// Checks its status, given the number of datagrams sent so far.
  void look(const nlohmann::ordered_json& status, std::uint64_t sent);
  /// Checks whether this machine, at this clock rate, scheduled the threads of the process in time.
  void look_at_delays(const SystemdStandIn::Life& life, double rate);
  /// Measures memory, descriptors and threads of the process.
  void weigh(const SystemdStandIn::Life& life);
  /// All counters restart at zero.
  void begin_life();
  /// Final checks at the end of the day.
  void conclude(std::uint64_t faults);

  [[nodiscard]] std::uint64_t lines() const { return lines_; }
  [[nodiscard]] double peak_rss_mb() const { return peak_rss_mb_; }
  /// Number of exact comparisons of sent and received datagrams.
  [[nodiscard]] std::uint64_t balances() const { return balances_; }

 private:
  struct Weight {
    double rss_mb = 0;
    int descriptors = 0, threads = 0;
  };
  static Weight weight_of(pid_t pid);

  void read(const std::string& line);
  [[nodiscard]] bool is_true(const std::string& line) const;
  void look_at_sums(const nlohmann::ordered_json& status);
  void look_at_growth(const nlohmann::ordered_json& status);
  void look_at_balance(const nlohmann::ordered_json& status, std::uint64_t sent);
  void look_at_claims(const nlohmann::ordered_json& status);

  Events& events_;
  nlohmann::ordered_json last_;             ///< status of this process
  int quiet_for_ = 0;                       ///< checks since the lidar fell silent
  std::optional<std::int64_t> unaccounted_; ///< datagrams sent while the service was down
  int weighed_life_ = 0;
  Weight first_weight_;
  std::map<std::string, std::int64_t> waited_ns_; ///< runqueue delay by thread of this process
  std::vector<double> rss_mb_;
  double peak_rss_mb_ = 0;
  std::uint64_t lines_ = 0, balances_ = 0;
};

} // namespace locus::test
