// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/escort.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <utility>

namespace locus::sim {
namespace {

constexpr double kTenth_s = 0.1;
constexpr double kFast_mps = 3;      // robot speed above which a van accompanies it
constexpr double kSample_m = 0.5;    // of the path
constexpr double kAlongside_m = 1.5; // from the robot's centre, ahead or behind
constexpr double kUnseen_m = 25;     // distance at which appearing or disappearing goes unnoticed

struct Manner {
  Passer::Kind kind;
  double half_width_m, half_length_m;
  double nearest_m, farthest_m; ///< lateral distance
  double behind_m;              ///< at its start
  double catch_up_mps, acceleration_mps2;
  double leave_mps; ///< relative to the robot; 0: stops instead
};
constexpr Manner kForklift{Passer::Kind::forklift, 0.55, 1.6, 2, 4, 6, 1, 1.2, 0};
constexpr Manner kVan{Passer::Kind::van, 0.95, 2.5, 3, 4, 60, 5, 2.5, 5};

/// Path of the robot parameterised by length, without its halts.
class Lane {
 public:
  explicit Lane(const Way& way) : way_(way) {
    along_m_.push_back(0);
    points_m_.push_back(smooth(0));
    for (std::size_t step = 1; step < way.steps(); ++step) {
      const double moved_m = (smooth(step) - smooth(step - 1)).norm();
      along_m_.push_back(along_m_.back() + moved_m);
      while (along_m_.back() >= kSample_m * static_cast<double>(points_m_.size())) {
        const double beyond_m = along_m_.back() - kSample_m * static_cast<double>(points_m_.size());
        const double share = moved_m > 0 ? beyond_m / moved_m : 0;
        points_m_.emplace_back(smooth(step) + share * (smooth(step - 1) - smooth(step)));
      }
    }
  }

  [[nodiscard]] double along_m(std::size_t step) const { return along_m_[std::min(step, along_m_.size() - 1)]; }
  [[nodiscard]] double length_m() const { return kSample_m * static_cast<double>(points_m_.size() - 1); }
  [[nodiscard]] std::size_t samples() const { return points_m_.size(); }

  /// Returns the point beside a sample; `aside_m` to the left.
  [[nodiscard]] Eigen::Vector2d beside(std::size_t i, double aside_m) const {
    const Eigen::Vector2d along = direction(i);
    return points_m_[i] + aside_m * Eigen::Vector2d{-along.y(), along.x()};
  }
  [[nodiscard]] Eigen::Vector2d at(double along_m, double aside_m) const {
    const double place = std::clamp(along_m / kSample_m, 0.0, static_cast<double>(points_m_.size() - 1));
    const std::size_t i = std::min(static_cast<std::size_t>(place), points_m_.size() - 1);
    const Eigen::Vector2d from = beside(i, aside_m), to = beside(std::min(i + 1, points_m_.size() - 1), aside_m);
    return from + (place - static_cast<double>(i)) * (to - from);
  }
  /// Returns the change of direction over three metres.
  [[nodiscard]] double bend_rad(std::size_t i) const {
    const std::size_t from = i < 3 ? 0 : i - 3, to = std::min(i + 3, points_m_.size() - 1);
    return std::abs(angle_between(direction(from), direction(to)));
  }

 private:
  /// Smooths out the oscillation of a gait.
  [[nodiscard]] Eigen::Vector2d smooth(std::size_t step) const {
    constexpr std::size_t kHalf = 5;
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    for (std::size_t i = 0; i <= 2 * kHalf; ++i)
      sum += way_.at(step + i < kHalf ? 0 : step + i - kHalf);
    return sum / (2 * kHalf + 1);
  }
  [[nodiscard]] Eigen::Vector2d direction(std::size_t i) const {
    const std::size_t from = i < 2 ? 0 : i - 2, to = std::min(i + 2, points_m_.size() - 1);
    const Eigen::Vector2d along = points_m_[to] - points_m_[from];
    return along.norm() > 0 ? Eigen::Vector2d(along.normalized()) : Eigen::Vector2d::UnitX();
  }

  const Way& way_;
  std::vector<double> along_m_;           ///< for each step
  std::vector<Eigen::Vector2d> points_m_; ///< kSample_m apart
};

/// One drive alongside: poses of the vehicle from the step at which it appears to that at which it disappears.
struct Job {
  std::size_t from, to;
  std::vector<Place> places;
};

class Driver {
 public:
  Driver(const Scene& scene, const Way& way, const Manner& manner)
      : scene_(scene), way_(way), lane_(way), as_(manner) {}

  /// Plans a drive beside the robot from about `start` for `steps`; nothing if that is impossible.
  [[nodiscard]] std::optional<Job> job(std::size_t start, std::size_t steps, double aside_m,
                                       std::size_t free_from) const {
    const auto drive = along_m(start, steps);
    if (drive.empty())
      return std::nullopt;
    const auto [first, last] = std::minmax_element(drive.begin(), drive.end());
    if (!has_room(*first - as_.half_length_m, *last + as_.half_length_m, aside_m))
      return std::nullopt;
    Job job{start, start + drive.size(), {}};
    if (as_.leave_mps == 0 && !(waits_unseen(job, drive, aside_m, free_from)))
      return std::nullopt;
    for (std::size_t step = job.from; step < job.to; ++step) {
      const std::size_t i = step < start ? 0 : std::min(step - start, drive.size() - 1);
      job.places.push_back(place(drive[i], aside_m));
    }
    return is_clear(job) ? std::optional(std::move(job)) : std::nullopt;
  }

 private:
  /// Returns positions along the lane per step: approaches, stays beside the robot, and leaves. Empty if impossible.
  [[nodiscard]] std::vector<double> along_m(std::size_t start, std::size_t steps) const {
    constexpr std::size_t kPatience = 300;
    const bool stops = as_.leave_mps == 0;
    const double robot_mps = (lane_.along_m(start + 5) - lane_.along_m(start)) / (5 * kTenth_s);
    double at_m = lane_.along_m(start) - as_.behind_m, speed_mps = stops ? 0 : robot_mps;
    if (at_m < 0)
      return {};
    std::vector<double> all;
    std::size_t beside = 0;
    for (std::size_t i = 0; i < 2 * kPatience + steps && start + i < way_.steps(); ++i) {
      const double gap_m = lane_.along_m(start + i) - at_m;
      const double its_mps = (lane_.along_m(start + i + 3) - lane_.along_m(start + i)) / (3 * kTenth_s);
      beside += beside > 0 || std::abs(gap_m) < kAlongside_m;
      const bool leaves = beside > steps;
      double wanted_mps = its_mps + std::clamp(0.6 * gap_m, -as_.catch_up_mps, as_.catch_up_mps);
      if (leaves)
        wanted_mps = stops ? 0 : its_mps + as_.leave_mps;
      const double change = as_.acceleration_mps2 * kTenth_s;
      speed_mps = std::max(0.0, speed_mps + std::clamp(wanted_mps - speed_mps, -change, change));
      all.push_back(at_m);
      at_m += kTenth_s * speed_mps;
      if (at_m > lane_.length_m() || (beside == 0 && i > kPatience))
        return {};
      if (leaves && (stops ? speed_mps == 0 : -gap_m > as_.behind_m))
        return all;
    }
    return {};
  }

  [[nodiscard]] Place place(double along_m, double aside_m) const {
    const Eigen::Vector2d here = lane_.at(along_m, aside_m);
    const Eigen::Vector2d ahead = lane_.at(along_m + 1, aside_m) - lane_.at(along_m - 1, aside_m);
    return {way_.on_ground(here).cast<float>(), static_cast<float>(std::atan2(ahead.y(), ahead.x())), 0};
  }

  /// Returns whether the area from the robot's path to the far side of the vehicle's is free and level across.
  [[nodiscard]] bool has_room(double from_m, double to_m, double aside_m) const {
    constexpr double kRoom_m = 0.3, kLevel_m = 0.25, kBend = 0.5;
    if (from_m < 0 || to_m > lane_.length_m())
      return false;
    const double side = aside_m > 0 ? 1 : -1, edge_m = aside_m + side * (as_.half_width_m + kRoom_m);
    const auto first = static_cast<std::size_t>(from_m / kSample_m), last = static_cast<std::size_t>(to_m / kSample_m);
    for (std::size_t i = first; i < last; ++i) {
      const Eigen::Vector2d middle = lane_.beside(i, 0), edge = lane_.beside(i, edge_m);
      const double near_m = aside_m - side * (as_.half_width_m + 0.1);
      if (lane_.bend_rad(i) / 3 * std::abs(edge_m) > kBend || !is_open(middle, edge) ||
          !is_open(edge, lane_.beside(i + 1, edge_m)) ||
          !is_open(lane_.beside(i, near_m), lane_.beside(i + 1, near_m)) ||
          std::abs(way_.on_ground(middle).z() - way_.on_ground(edge).z()) > kLevel_m)
        return false;
    }
    return true;
  }

  [[nodiscard]] bool is_open(const Eigen::Vector2d& from, const Eigen::Vector2d& to) const {
    const Eigen::Vector2d way = to - from;
    return std::ranges::all_of(std::array{0.4, 1.2}, [&](double height_m) {
      const Eigen::Vector3d begin = way_.on_ground(from) + Eigen::Vector3d{0, 0, height_m};
      const Eigen::Vector3d end = way_.on_ground(to) + Eigen::Vector3d{0, 0, height_m};
      const double length_m = (end - begin).norm();
      return way.norm() <= 1e-6 || !scene_.cast({begin, (end - begin) / length_m}, length_m, way_.begin);
    });
  }

  /// Extends the job so that the vehicle appears and disappears, at rest, out of the robot's sight.
  [[nodiscard]] bool waits_unseen(Job& job, const std::vector<double>& drive, double aside_m,
                                  std::size_t free_from) const {
    const auto waits_m = lane_.at(drive.front(), aside_m), stops_m = lane_.at(drive.back(), aside_m);
    while (job.from > free_from && !is_unseen(job.from, waits_m))
      --job.from;
    while (job.to < way_.steps() && !is_unseen(job.to, stops_m))
      ++job.to;
    return job.from > free_from || free_from == 0; // may be there when the drive begins
  }

  [[nodiscard]] bool is_unseen(std::size_t step, const Eigen::Vector2d& place) const {
    const Eigen::Vector2d robot = way_.at(step);
    return (robot - place).norm() > kUnseen_m || !is_open(robot, place);
  }

  /// Returns whether the vehicle keeps clear of the robot and of others throughout.
  [[nodiscard]] bool is_clear(const Job& job) const {
    constexpr double kGap_m = 0.3;
    for (std::size_t i = 0; i < job.places.size(); ++i) {
      const Place& place = job.places[i];
      const Eigen::Vector2d here = place.ground_m.head<2>().cast<double>();
      const Eigen::Vector2d ahead{std::cos(place.yaw_rad), std::sin(place.yaw_rad)};
      const auto gap_to = [&](const Eigen::Vector2d& other) {
        const Eigen::Vector2d off = other - here;
        const double along = std::max(0.0, std::abs(off.dot(ahead)) - as_.half_length_m);
        const double across = std::max(0.0, std::abs(off.x() * ahead.y() - off.y() * ahead.x()) - as_.half_width_m);
        return std::hypot(along, across);
      };
      if (gap_to(way_.at(job.from + i)) < way_.reach_m + kGap_m)
        return false;
      for (const Passer& passer : scene_.passers()) {
        constexpr double kHalfCar_m = 1;
        if (gap_to(passer.at(way_.stamp(job.from + i)).ground_m.head<2>().cast<double>()) < kHalfCar_m + kGap_m)
          return false;
      }
    }
    return true;
  }

  const Scene& scene_;
  const Way& way_;
  Lane lane_;
  const Manner& as_;
};

/// Finds a job in this minute, at a suitable time and side, shorter than requested if necessary.
std::optional<Job> job_in_minute(const Driver& driver, const Manner& as, std::size_t minute, double seconds,
                                 std::size_t free_from, Dice& dice) {
  constexpr std::size_t kPerMinute = 600;
  constexpr int kTries = 60;
  constexpr double kWorthIt_s = 2;
  for (double wanted_s = seconds; wanted_s >= std::min(seconds, kWorthIt_s); wanted_s *= 0.6) {
    for (int i = 0; i < kTries; ++i) {
      const std::size_t start = minute * kPerMinute + dice.below(kPerMinute);
      const double aside_m = (dice.chance(0.5) ? 1 : -1) * dice.between(as.nearest_m, as.farthest_m);
      if (start < free_from)
        continue;
      if (auto job = driver.job(start, static_cast<std::size_t>(wanted_s / kTenth_s), aside_m, free_from))
        return job;
    }
  }
  return std::nullopt;
}

} // namespace

std::optional<Passer> escort(const Scene& scene, const Way& way, double seconds_per_min, Dice& dice) {
  double fastest_mps = 0;
  for (std::size_t step = 0; step < way.steps(); step += 10)
    fastest_mps = std::max(fastest_mps, way.velocity_mps(step).norm());
  const Manner& as = fastest_mps > kFast_mps ? kVan : kForklift;
  const Driver driver(scene, way, as);
  std::vector<Place> places(way.steps(), {{Track::kAway_m, Track::kAway_m, 0}});
  std::size_t free_from = 0;
  for (std::size_t minute = 0; minute * 600 < way.steps(); ++minute) {
    const auto job = job_in_minute(driver, as, minute, seconds_per_min, free_from, dice);
    if (!job)
      continue;
    std::copy(job->places.begin(), job->places.end(), places.begin() + static_cast<std::ptrdiff_t>(job->from));
    free_from = job->to;
  }
  if (free_from == 0)
    return std::nullopt;
  return Passer(as.kind, std::make_shared<Track>(std::move(places), false), way.begin);
}

} // namespace locus::sim
