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

/// Judges what the service tells of itself: that its counters add up, that what was sent to it is accounted for, that
/// it blames nobody who is sound, and that it holds no more than it needs. One owner.
class ServiceJudge {
 public:
  explicit ServiceJudge(Events& events) : events_(events) {}

  /// Of what the service has said on stderr, and how its lives ended.
  void read(const std::vector<std::string>& lines);
  /// Its status, when so many datagrams had been sent.
  void look(const nlohmann::ordered_json& status, std::uint64_t sent);
  /// Whether this machine, whose clock is so many times as fast, let the threads of this life run in time.
  void look_at_delays(const SystemdStandIn::Life& life, double rate);
  /// What the process of this life holds.
  void weigh(const SystemdStandIn::Life& life);
  /// All counters begin anew.
  void begin_life();
  /// At the end of the day.
  void conclude(std::uint64_t faults);

  [[nodiscard]] std::uint64_t lines() const { return lines_; }
  [[nodiscard]] double peak_rss_mb() const { return peak_rss_mb_; }
  /// How often it was verified to the packet that none was lost uncounted.
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
  nlohmann::ordered_json last_;             ///< status of this life
  int quiet_for_ = 0;                       ///< looks since the lidar fell silent
  std::optional<std::int64_t> unaccounted_; ///< datagrams that were sent while nobody listened
  int weighed_life_ = 0;
  Weight first_weight_;
  std::map<std::string, std::int64_t> waited_ns_; ///< for a processor, by thread of this life
  std::vector<double> rss_mb_;
  double peak_rss_mb_ = 0;
  std::uint64_t lines_ = 0, balances_ = 0;
};

} // namespace locus::test
