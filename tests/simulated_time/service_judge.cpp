// SPDX-License-Identifier: Apache-2.0
#include "simulated_time/service_judge.hpp"

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <initializer_list>
#include <iterator>
#include <numeric>
#include <string_view>
#include <utility>

#include <fmt/format.h>

namespace locus::test {
namespace {

using nlohmann::ordered_json;
using std::chrono::seconds;
using enum DayFault;

/// A log message, and the recent faults of which one must explain it.
struct Claim {
  std::string_view text; ///< part of the line
  std::vector<DayFault> causes;
  Duration within = seconds{20};
};

const std::vector<Claim>& claims() {
  static const std::vector<Claim> kClaims{
      {"the clock of this computer stepped by", {clock_step, process_stop, thread_hang}},
      {"dead reckoning: no sweep can be registered",
       {lidar_lost, process_stop, thread_hang, crash, reload, flood, link_down}},
      {"motion source imu: nothing received since the start", {imu_lost, link_down, crash}},
      {"motion source wio: nothing received since the start", {odometry_lost, link_down, crash}},
      {"motion source wio: messages on", {second_odometry}},
      {"motion source imu is lost (stale)", {imu_lost, link_down, process_stop, thread_hang, deaf_reader, crash}},
      {"motion source wio is lost (stale)", {odometry_lost, link_down, process_stop, thread_hang, deaf_reader, crash}},
      {"motion source wio is lost (jump)", {odometry_lost, link_down, process_stop, thread_hang, second_odometry}},
      {"check its power and cable", {lidar_lost}},
      {"other senders use its port", {garbage, flood}},
      {"its packets are rejected", {garbage, flood}},
      {"packets come from 127.0.0.2", {garbage, flood}},
      {"this computer is overloaded", {process_stop, thread_hang, flood, crash, reload}}, // relocalisation takes time
      {"and lidar disagree on how", {lidar_lost, process_stop, thread_hang, crash, reload, flood}},
      {"the kernel dropped", {process_stop, thread_hang, flood}},
      {"the ports of the lidars are flooded", {flood}},
      {"inputs were not recorded", {disk_full, process_stop, thread_hang}},
      {"the odometry continues without a recording", {disk_full}, seconds{30}},
      {"the state cannot be saved", {disk_full}, seconds{40}},
      {"reload rejected", {broken_config}},
      {"starting without the saved pose: it is newer than the clock", {clock_step}, std::chrono::hours{30}},
      {"starting without the saved pose: it is", {clock_step, disk_full, lidar_lost}, std::chrono::minutes{10}},
      {"started at the origin: the first sweep does not match",
       {odometry_lost, lidar_lost, link_down, clock_step, disk_full},
       seconds{60}},
      {"resumed at the pose of an odometry source",
       {lidar_lost, crash, process_stop, thread_hang, disk_full},
       seconds{60}},
      {"Z_restart", {crash, process_stop, thread_hang}, seconds{60}}, // incidents
      {"Z_tracking_lost", {lidar_lost, process_stop, thread_hang, crash, reload, flood, link_down}},
      {"Z_contradiction", {lidar_lost, process_stop, thread_hang, crash, reload, flood, second_odometry}, seconds{60}},
      {"the incident cannot be stored", {disk_full}, seconds{30}},
      {"the previous run crashed less than five minutes after another",
       {crash, process_stop, thread_hang},
       seconds{60}},
      {"Cyclone DDS", {link_down}, seconds{30}},
      {"retrying", {link_down}},
  };
  return kClaims;
}

/// Messages that need no explanation.
constexpr std::array<std::string_view, 14> kAlwaysTrue{"DDS is up",
                                                       "degenerate", // in a corner of the course
                                                       "tracking",
                                                       "standstill",
                                                       "is used again",
                                                       ": data received",
                                                       "recording to",
                                                       "reloaded",
                                                       "resumed from the saved state",
                                                       "running with",
                                                       "run ended",
                                                       "started at the origin",
                                                       "started at the requested pose",
                                                       "stopped"};

bool contains(const std::string& line, std::string_view part) { return line.find(part) != std::string::npos; }

std::uint64_t sum(const ordered_json& counts) {
  return std::accumulate(counts.begin(), counts.end(), std::uint64_t{0},
                         [](std::uint64_t total, const ordered_json& one) { return total + one.get<std::uint64_t>(); });
}

} // namespace

void ServiceJudge::read(const std::vector<std::string>& lines) {
  for (const std::string& line : lines)
    read(line);
}

void ServiceJudge::read(const std::string& line) {
  ++lines_;
  fmt::print("  {:9.2f} s: {}\n", to_seconds(events_.now()), line);
  if (line.starts_with("exit ")) {
    if (line != "exit 137" || !events_.any({crash, process_stop, thread_hang}, seconds{10}))
      events_.find("the service ended by itself: " + line);
  } else if (!is_true(line)) {
    events_.find("a message without a cause: " + line);
  }
}

bool ServiceJudge::is_true(const std::string& line) const {
  const auto claim = std::ranges::find_if(claims(), [&](const Claim& one) { return contains(line, one.text); });
  if (claim != claims().end())
    return std::ranges::any_of(claim->causes,
                               [&](DayFault cause) { return events_.since_end(cause) <= claim->within; });
  return std::ranges::any_of(kAlwaysTrue, [&](std::string_view part) { return contains(line, part); });
}

void ServiceJudge::begin_life() {
  last_ = {};
  unaccounted_.reset();
  waited_ns_.clear();
}

void ServiceJudge::look(const ordered_json& status, std::uint64_t sent) {
  look_at_sums(status);
  if (!last_.is_null())
    look_at_growth(status);
  look_at_balance(status, sent);
  look_at_claims(status);
  last_ = status;
}

void ServiceJudge::look_at_sums(const ordered_json& status) {
  const ordered_json& total = status["packets"]["total"];
  const auto count = [](const ordered_json& of, const char* name) { return of[name].get<std::uint64_t>(); };
  if (count(total, "received") != count(total, "data") + count(total, "position") + sum(total["rejected"]))
    events_.find("packets do not add up: " + total.dump());
  const ordered_json& sweeps = status["sweeps"];
  const std::uint64_t ended = count(sweeps, "processed") + count(sweeps, "dropped") + count(sweeps, "failed");
  constexpr std::uint64_t kOnTheirWay = 2;
  if (ended > count(sweeps, "seen") + 1 || ended + kOnTheirWay < count(sweeps, "seen"))
    events_.find("sweeps do not add up: " + sweeps.dump());
}

void ServiceJudge::look_at_growth(const ordered_json& status) {
  const ordered_json now = status.flatten(), before = last_.flatten();
  for (const auto& [key, value] : now.items()) {
    const bool may_fall = key.ends_with("/lost"); // reduced when late packets arrive
    const bool is_count =
        !may_fall && (key.starts_with("/packets/") || key.starts_with("/sweeps/") || key.starts_with("/dropped/") ||
                      contains(key, "/received") || contains(key, "/rejected/") || contains(key, "/used_sweeps") ||
                      contains(key, "/recorded") || contains(key, "/refused"));
    if (is_count && value.is_number() && before.contains(key) && before[key].is_number() && value < before[key])
      events_.find(fmt::format("{} decreases from {} to {}", key, before[key].dump(), value.dump()));
  }
}

/// Compares sent and received datagrams exactly, once the lidar is silent and everything sent has been processed.
void ServiceJudge::look_at_balance(const ordered_json& status, std::uint64_t sent) {
  const bool is_quiet = events_.is_on(lidar_lost) && quiet_for_ >= 3 &&
                        !events_.any({garbage, flood, late, process_stop, thread_hang}, seconds{3});
  quiet_for_ = events_.is_on(lidar_lost) ? quiet_for_ + 1 : 0;
  if (!is_quiet)
    return;
  const std::uint64_t accounted = status["packets"]["total"]["received"].get<std::uint64_t>() +
                                  status["packets"]["kernel_drops"].get<std::uint64_t>() +
                                  status["dropped"]["flood_datagrams"].get<std::uint64_t>();
  const auto difference = static_cast<std::int64_t>(sent) - static_cast<std::int64_t>(accounted);
  if (unaccounted_ && difference != *unaccounted_)
    events_.find(fmt::format("{} of {} datagrams are not accounted for", difference - *unaccounted_, sent));
  balances_ += unaccounted_ ? 1U : 0U;
  unaccounted_ = difference;
}

void ServiceJudge::look_at_claims(const ordered_json& status) {
  for (const auto& [name, lidar] : status["lidars"].items())
    if (const std::string problem = lidar.value("problem", "");
        !problem.empty() && !events_.any({lidar_lost, garbage, flood, process_stop, thread_hang}, seconds{10}))
      events_.find(fmt::format("the status reports a problem of lidar {}: {}", name, problem));
  if (const ordered_json& recording = status["recording"];
      !recording.value("problem", "").empty() && !events_.any({disk_full}, seconds{30}))
    events_.find("it does not record although there is space: " + recording.value("problem", ""));
}

/// Detects overload of this machine: a runnable thread of the service has waited this long for a processor.
void ServiceJudge::look_at_delays(const SystemdStandIn::Life& life, double rate) {
  constexpr Duration kTooLong = std::chrono::milliseconds{30};
  std::error_code gone;
  for (const auto& task : std::filesystem::directory_iterator("/proc/" + std::to_string(life.pid) + "/task", gone)) {
    std::int64_t ran_ns = 0, waited_ns = 0;
    std::ifstream(task.path() / "schedstat") >> ran_ns >> waited_ns;
    const auto [known, is_new] = waited_ns_.try_emplace(task.path().filename(), waited_ns);
    const double waits_ns = rate * static_cast<double>(waited_ns - std::exchange(known->second, waited_ns));
    if (!is_new && waits_ns > static_cast<double>(kTooLong.count()))
      events_.disturb(fmt::format("a thread of the service waited {:.0f} ms for a processor", 1e-6 * waits_ns));
  }
}

ServiceJudge::Weight ServiceJudge::weight_of(pid_t pid) {
  const std::filesystem::path process = "/proc/" + std::to_string(pid);
  const auto entries = [](const std::filesystem::path& folder) {
    std::error_code gone;
    const std::filesystem::directory_iterator all(folder, gone);
    return static_cast<int>(std::distance(begin(all), end(all)));
  };
  Weight weight{0, entries(process / "fd"), entries(process / "task")};
  std::ifstream status(process / "status");
  for (std::string line; std::getline(status, line);)
    if (line.starts_with("VmRSS:"))
      weight.rss_mb = 1.024e-3 * std::stod(line.substr(6));
  return weight;
}

void ServiceJudge::weigh(const SystemdStandIn::Life& life) {
  constexpr int kMoreDescriptors = 3, kMoreThreads = 2; ///< beyond the first measurement
  const Weight weight = weight_of(life.pid);
  if (weight.threads == 0 || events_.any({link_down, disk_full}, seconds{30})) // fewer than usual
    return;
  peak_rss_mb_ = std::max(peak_rss_mb_, weight.rss_mb);
  rss_mb_.push_back(weight.rss_mb);
  if (std::exchange(weighed_life_, life.number) != life.number) {
    first_weight_ = weight;
    return;
  }
  if (weight.descriptors > first_weight_.descriptors + kMoreDescriptors ||
      weight.threads > first_weight_.threads + kMoreThreads)
    events_.find(fmt::format("{} descriptors and {} threads, and {} and {} at first", weight.descriptors,
                             weight.threads, first_weight_.descriptors, first_weight_.threads));
}

/// Compares the peak memory of the last quarter of the day with that of the second.
void ServiceJudge::conclude(std::uint64_t faults) {
  constexpr double kMostGrowth_mb = 16;
  constexpr std::uint64_t kMostLinesPerFault = 20, kMostLinesPerMinute = 12;
  if (const std::size_t quarter = rss_mb_.size() / 4; quarter > 0) {
    const auto largest = [&](std::size_t from) {
      return *std::max_element(rss_mb_.begin() + static_cast<std::ptrdiff_t>(from),
                               rss_mb_.begin() + static_cast<std::ptrdiff_t>(from + quarter));
    };
    if (const double growth = largest(3 * quarter) - largest(quarter); growth > kMostGrowth_mb)
      events_.find(fmt::format("memory grew by {:.1f} MB", growth));
  }
  const auto minutes = static_cast<std::uint64_t>(events_.now() / std::chrono::minutes{1});
  if (lines_ > kMostLinesPerFault * faults + kMostLinesPerMinute * (minutes + 1))
    events_.find(fmt::format("{} lines of log for {} faults", lines_, faults));
}

} // namespace locus::test
