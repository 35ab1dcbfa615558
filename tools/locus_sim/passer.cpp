// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/passer.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "locus_sim/figures.hpp"

namespace locus::sim {
namespace {

constexpr float kFarthestStep_m = 4; // equals 40 m/s

bool is_one_way(const Place& from, const Place& to) {
  return (to.ground_m - from.ground_m).squaredNorm() < kFarthestStep_m * kFarthestStep_m;
}

double reach_of(Passer::Kind kind) {
  switch (kind) {
  case Passer::Kind::person:
    return 0.75; // leg put forward
  case Passer::Kind::forklift:
    return 2;
  case Passer::Kind::car:
  case Passer::Kind::van:
    break;
  }
  return 2.75;
}

std::vector<Surface> rigid_parts(Passer::Kind kind) {
  switch (kind) {
  case Passer::Kind::person:
    return {};
  case Passer::Kind::forklift:
    return forklift(0);
  case Passer::Kind::car:
    return car();
  case Passer::Kind::van:
    break;
  }
  return van();
}

/// Frame of an upright object.
struct Frame {
  Eigen::Vector3d origin_m;
  double c, s;

  explicit Frame(const Place& place)
      : origin_m(place.ground_m.cast<double>()), c(std::cos(static_cast<double>(place.yaw_rad))),
        s(std::sin(static_cast<double>(place.yaw_rad))) {}

  [[nodiscard]] Eigen::Vector3d into(const Eigen::Vector3d& v) const {
    return {c * v.x() + s * v.y(), c * v.y() - s * v.x(), v.z()};
  }
  [[nodiscard]] Eigen::Vector3d out_of(const Eigen::Vector3d& v) const {
    return {c * v.x() - s * v.y(), s * v.x() + c * v.y(), v.z()};
  }
};

} // namespace

Track::Track(std::vector<Place> places, bool closed) : places_(std::move(places)), closed_(closed) {
  if (places_.empty())
    throw std::invalid_argument("Track: needs a place at least");
  for (std::size_t i = 1; i < places_.size(); ++i)
    if (is_one_way(places_[i - 1], places_[i]))
      reach_m_ = std::max(reach_m_, static_cast<double>((places_[i].ground_m - places_[i - 1].ground_m).norm()));
}

std::size_t Track::index(std::int64_t step) const {
  const auto count = static_cast<std::int64_t>(places_.size());
  if (step < 0)
    return 0;
  return static_cast<std::size_t>(closed_ ? step % count : std::min(step, count - 1));
}

Place Track::at(Duration since) const {
  const std::int64_t step = since / kStep;
  const Place &from = places_[index(step)], &to = places_[index(step + 1)];
  if (since < Duration::zero() || !is_one_way(from, to))
    return from;
  const auto share = static_cast<float>(to_seconds(since - step * kStep) / to_seconds(kStep));
  const auto between = [&](float a, float b) { return a + share * (b - a); };
  float turn = to.yaw_rad - from.yaw_rad;
  if (closed_) // from its end to its start
    turn = std::remainder(turn, 6.2831853F);
  return {from.ground_m + share * (to.ground_m - from.ground_m), from.yaw_rad + share * turn,
          between(from.swing_rad, to.swing_rad)};
}

Passer::Passer(Kind kind, std::shared_ptr<const Track> track, Stamp begin)
    : kind_(kind), track_(std::move(track)), begin_(begin), parts_(rigid_parts(kind)),
      radius_m_(reach_of(kind) + track_->reach_m()) {}

std::vector<Surface> Passer::parts(const Place& place) const {
  return kind_ == Kind::person ? walking_person(static_cast<double>(place.swing_rad)) : parts_;
}

/// Returns whether the ray passes over the enclosing circle, viewed from above.
bool Passer::may_be_met_by(const Ray& ray, double max_range_m, Stamp stamp) const {
  const Eigen::Vector3f& ground_m = track_->near(stamp - begin_).ground_m;
  const double x = static_cast<double>(ground_m.x()) - ray.origin_m.x();
  const double y = static_cast<double>(ground_m.y()) - ray.origin_m.y();
  const double dx = ray.direction.x(), dy = ray.direction.y();
  const double aside = x * dy - y * dx, ahead = x * dx + y * dy, level = dx * dx + dy * dy;
  const double radius_squared = radius_m_ * radius_m_;
  return aside * aside <= radius_squared * level &&
         (ahead > 0 ? ahead <= max_range_m * level + radius_m_ * std::sqrt(level) : x * x + y * y <= radius_squared);
}

std::optional<Passer::Met> Passer::met_by(const Ray& ray, double max_range_m, Stamp stamp) const {
  if (!may_be_met_by(ray, max_range_m, stamp))
    return std::nullopt;
  const Place place = at(stamp);
  const Frame frame(place);
  const Ray own{frame.into(ray.origin_m - frame.origin_m), frame.into(ray.direction)};
  const auto meet = [&](const std::vector<Surface>& all) -> std::optional<Met> {
    const Surface* nearest = nullptr;
    double range_m = max_range_m;
    for (const Surface& part : all) {
      const double range = std::visit([&](const auto& shape) { return shape.range_m(own); }, part.shape);
      if (range < range_m) {
        range_m = range;
        nearest = &part;
      }
    }
    if (nearest == nullptr)
      return std::nullopt;
    const Eigen::Vector3d point = own.origin_m + range_m * own.direction;
    const Eigen::Vector3d normal = std::visit([&](const auto& shape) { return shape.normal(point); }, nearest->shape);
    return Met{range_m, frame.out_of(normal), nearest->reflectivity};
  };
  return kind_ == Kind::person ? meet(parts(place)) : meet(parts_);
}

double Passer::distance_m(const Eigen::Vector3d& point, Stamp stamp) const {
  const Place place = at(stamp);
  const Frame frame(place);
  const Eigen::Vector3d own = frame.into(point - frame.origin_m);
  double nearest = kNowhere;
  for (const Surface& part : parts(place))
    nearest = std::min(nearest, std::visit([&](const auto& shape) { return shape.distance_m(own); }, part.shape));
  return nearest;
}

} // namespace locus::sim
