// SPDX-License-Identifier: Apache-2.0
#include "discovery/motion_candidates.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "core/sources/health_monitor.hpp"
#include "core/sources/motion_sample.hpp"

namespace locus::tools {
namespace {

const double kLeastImuRate_hz = 1.0 / to_seconds(HealthMonitor::kLongestImuPeriod);
constexpr double kGravityTolerance = 0.15; ///< relative, as of the self-check of an IMU

bool is_about(double value, double expected) { return std::abs(value - expected) <= kGravityTolerance * expected; }

/// Criterion of a choice: a better candidate has a larger value.
struct Criterion {
  std::function<double(const MotionCandidate&)> value;
  std::function<std::string(const MotionCandidate& chosen, const MotionCandidate& other)> why_not;
};

bool is_named_after_lidar(const std::string& topic) {
  constexpr std::array<std::string_view, 13> kWords{"lidar", "laser", "loam", "lio", "slam", "icp",  "gicp",
                                                    "map",   "truth", "gt",   "aft", "scan", "locus"};
  std::string words = "_";
  for (const char c : topic) {
    const auto letter = static_cast<unsigned char>(c);
    words += std::isalnum(letter) != 0 ? static_cast<char>(std::tolower(letter)) : '_';
  }
  words += '_';
  return std::ranges::any_of(kWords, [&](std::string_view word) {
    return words.find(fmt::format("_{}_", word)) != std::string::npos ||
           (word.size() > 3 && words.find(word) != std::string::npos);
  });
}

Criterion is_usual_topic(const std::string& usual) {
  return {[usual](const MotionCandidate& one) { return one.topic == usual ? 1.0 : 0.0; },
          [](const MotionCandidate& chosen, const MotionCandidate&) {
            return fmt::format("{} is the usual topic", chosen.topic);
          }};
}

const Criterion& has_most_messages() {
  static const Criterion criterion{[](const MotionCandidate& one) { return one.rate_hz(); },
                                   [](const MotionCandidate& chosen, const MotionCandidate& other) {
                                     return fmt::format("{:.0f} messages a second, {} has {:.0f}", other.rate_hz(),
                                                        chosen.topic, chosen.rate_hz());
                                   }};
  return criterion;
}

std::vector<Criterion> criteria_for_imu(const std::string& usual,
                                        const std::function<bool(const std::string&)>& is_placed) {
  return {{[](const MotionCandidate& one) { return one.is_too_slow() ? 0.0 : 1.0; },
           [](const MotionCandidate&, const MotionCandidate& other) {
             return fmt::format("{:.0f} messages a second are too few to be used", other.rate_hz());
           }},
          is_usual_topic(usual),
          {[&is_placed](const MotionCandidate& one) { return is_placed(one.frame) ? 1.0 : 0.0; },
           [](const MotionCandidate& chosen, const MotionCandidate& other) {
             return fmt::format("/tf_static does not place its frame '{}' on the robot, but that of {}", other.frame,
                                chosen.topic);
           }},
          {[](const MotionCandidate& one) { return one.measures_gravity() ? 1.0 : 0.0; },
           [](const MotionCandidate& chosen, const MotionCandidate& other) {
             return fmt::format("measures {:.1f} m/s^2 in the mean, {} measures gravity", other.mean_force_mps2(),
                                chosen.topic);
           }},
          has_most_messages()};
}

std::vector<Criterion> criteria_for_odometry(const std::string& usual, const std::string& base) {
  return {{[](const MotionCandidate& one) { return one.moves() ? 1.0 : 0.0; },
           [](const MotionCandidate& chosen, const MotionCandidate& other) {
             return fmt::format("moves {:.2f} m at most, {} moves with the robot", other.extent_m, chosen.topic);
           }},
          {[](const MotionCandidate& one) { return is_named_after_lidar(one.topic) ? 0.0 : 1.0; },
           [](const MotionCandidate&, const MotionCandidate&) -> std::string {
             return "by its name a result of lidar, whose errors it repeats, or the truth";
           }},
          is_usual_topic(usual),
          {[base](const MotionCandidate& one) { return one.frame == base ? 1.0 : 0.0; },
           [base](const MotionCandidate& chosen, const MotionCandidate& other) {
             return fmt::format("reports the motion of '{}', {} that of {}", other.frame, chosen.topic, base);
           }},
          has_most_messages()};
}

/// Returns the first criterion in which the chosen candidate is better.
std::string why_not(const MotionCandidate& other, const MotionCandidate& chosen,
                    const std::vector<Criterion>& criteria) {
  for (const Criterion& criterion : criteria)
    if (criterion.value(other) < criterion.value(chosen))
      return criterion.why_not(chosen, other);
  return fmt::format("as good as {}, which is the first by name", chosen.topic);
}

/// Sorts the best candidate to the front.
void sort(std::vector<MotionCandidate>& candidates, const std::vector<Criterion>& criteria) {
  std::ranges::sort(candidates, {}, &MotionCandidate::topic);
  std::ranges::stable_sort(candidates, [&](const MotionCandidate& a, const MotionCandidate& b) {
    for (const Criterion& criterion : criteria)
      if (const double of_a = criterion.value(a), of_b = criterion.value(b); of_a != of_b)
        return of_a > of_b;
    return false;
  });
}

void choose(std::vector<MotionCandidate> candidates, std::size_t index, const std::vector<Criterion>& criteria,
            Config& config, ConfigReasons& reasons) {
  if (candidates.empty())
    return;
  sort(candidates, criteria);
  const MotionCandidate& chosen = candidates.front();
  MotionSource& source = config.motion_sources[index];
  const std::string others = candidates.size() == 1 ? "the only one" : why_not(candidates[1], chosen, criteria);
  reasons.of_key[fmt::format("motion_sources.{}.topic", index)] =
      fmt::format("{}; {}", chosen.text(),
                  candidates.size() == 1 ? others : fmt::format("not {}: {}", candidates[1].topic, others));
  source.topic = chosen.topic;
  for (std::size_t i = 1; i < candidates.size(); ++i) {
    MotionSource other = source;
    other.name = fmt::format("{}{}", source.name, i + 1);
    other.topic = candidates[i].topic;
    reasons.other_sources.push_back(
        {other, fmt::format("{}; {}", candidates[i].text(), why_not(candidates[i], chosen, criteria))});
  }
}

} // namespace

void MotionCandidate::add(const daemon::ros::Imu& message, Stamp received) {
  count(received);
  const auto& force = message.linear_acceleration_;
  force_sum_mps2 += Eigen::Vector3d{force.x_, force.y_, force.z_}.norm();
}

void MotionCandidate::add(const daemon::ros::Odometry& message, Stamp received) {
  count(received);
  const auto& p = message.pose_.pose_.position_;
  const Eigen::Vector3d position{p.x_, p.y_, p.z_};
  if (!position.allFinite())
    return;
  first_position = first_position.value_or(position);
  extent_m = std::max(extent_m, (position - *first_position).norm());
}

void MotionCandidate::count(Stamp received) {
  ++messages;
  first = first.value_or(received);
  latest = received;
  later += received > *first ? 1U : 0U;
}

double MotionCandidate::rate_hz() const {
  const double lasted_s = first ? to_seconds(latest - *first) : 0;
  return lasted_s > 0 ? static_cast<double>(later) / lasted_s : 0;
}

bool MotionCandidate::is_too_slow() const {
  return kind == SourceKind::imu && rate_hz() > 0 && rate_hz() < kLeastImuRate_hz;
}

double MotionCandidate::mean_force_mps2() const {
  return messages > 0 ? force_sum_mps2 / static_cast<double>(messages) : 0;
}

bool MotionCandidate::measures_gravity() const { return is_about(mean_force_mps2(), kGravity_mps2); }

std::string MotionCandidate::text() const {
  if (kind == SourceKind::odometry)
    return fmt::format("nav_msgs/Odometry, {:.0f} Hz{}{}", rate_hz(), frame.empty() ? "" : " of " + frame,
                       moves() ? ", moves" : "");
  const std::string unit = measures_gravity()               ? "in m/s^2, as required"
                           : is_about(mean_force_mps2(), 1) ? "so in g and not in m/s^2: accelerations are not used"
                                                            : "not that of gravity: accelerations are not used";
  const std::string too_slow =
      is_too_slow() ? fmt::format(" (too slow to be used, {:.0f} Hz are needed)", std::ceil(kLeastImuRate_hz)) : "";
  return fmt::format("sensor_msgs/Imu, {:.0f} Hz{}, measures {:.2f} in the mean, {}", rate_hz(), too_slow,
                     mean_force_mps2(), unit);
}

void choose_sources(std::vector<MotionCandidate> candidates, const std::function<bool(const std::string&)>& is_placed,
                    Config& config, ConfigReasons& reasons) {
  for (const SourceKind kind : {SourceKind::odometry, SourceKind::imu}) {
    const auto source = std::ranges::find(config.motion_sources, kind, &MotionSource::kind);
    if (source == config.motion_sources.end())
      continue;
    std::vector<MotionCandidate> of_kind;
    std::ranges::copy_if(candidates, std::back_inserter(of_kind),
                         [&](const MotionCandidate& one) { return one.kind == kind; });
    const auto index = static_cast<std::size_t>(source - config.motion_sources.begin());
    choose(std::move(of_kind), index,
           kind == SourceKind::imu ? criteria_for_imu(source->topic, is_placed)
                                   : criteria_for_odometry(source->topic, config.dds.frame_base),
           config, reasons);
  }
}

} // namespace locus::tools
