// SPDX-License-Identifier: Apache-2.0
#include "core/scan_normals.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/principal_axes.hpp"

namespace locus {

namespace {

/// Neighbours farther than this share of the range lie on another surface, or too far away to speak for this one.
constexpr float kMaxDistancePerRange = 0.15F;
constexpr float kMinReach_m = 0.6F;

constexpr double kMaxRoughness_m = 0.04;     ///< across the plane, one standard deviation
constexpr double kMinMiddleToLargest = 0.02; ///< below this they lie on one line
constexpr double kMaxSmallestToMiddle = 0.1;
constexpr std::size_t kMinNeighbours = 5;

/// Centred moments of a point and its neighbours; at most three on each of three lines.
class Neighbourhood {
 public:
  explicit Neighbourhood(const Eigen::Vector3f& centre)
      : centre_(centre), reach2_(std::max(kMinReach_m, kMaxDistancePerRange * centre.norm())) {
    reach2_ *= reach2_;
  }

  void add(const Eigen::Vector3f& point) {
    const Eigen::Vector3f offset = point - centre_;
    if (offset.squaredNorm() > reach2_)
      return;
    const Eigen::Vector3d d = offset.cast<double>();
    sum_ += d;
    outer_ += d * d.transpose();
    ++count_;
  }

  /// Unit normal towards the lidar's side, or zero.
  [[nodiscard]] Eigen::Vector3f normal() const {
    if (count_ < kMinNeighbours)
      return Eigen::Vector3f::Zero();
    const auto n = static_cast<double>(count_);
    const Eigen::Matrix3d covariance = (outer_ - sum_ * sum_.transpose() / n) / n;
    const auto [variance, axis] = principal_axes(covariance);
    if (variance[0] > kMaxRoughness_m * kMaxRoughness_m || variance[1] < kMinMiddleToLargest * variance[2] ||
        variance[0] > kMaxSmallestToMiddle * variance[1])
      return Eigen::Vector3f::Zero();
    const Eigen::Vector3f normal = axis.cast<float>();
    return normal.dot(centre_) > 0.0F ? -normal : normal;
  }

 private:
  Eigen::Vector3f centre_;
  float reach2_;
  Eigen::Vector3d sum_ = Eigen::Vector3d::Zero();
  Eigen::Matrix3d outer_ = Eigen::Matrix3d::Zero();
  std::size_t count_ = 0;
};

} // namespace

void ScanNormals::estimate(std::vector<SweepPoint>& points) {
  lines_.clear();
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (lines_.empty() || lines_.back().id != points[i].scan_line)
      lines_.push_back({points[i].scan_line, i, i});
    lines_.back().end = i + 1;
  }
  for (std::size_t l = 0; l < lines_.size(); ++l) {
    const Line& line = lines_[l];
    std::array<const Line*, 2> beside{};
    if (l > 0 && lines_[l - 1].id + 1 == line.id)
      beside[0] = &lines_[l - 1];
    if (l + 1 < lines_.size() && line.id + 1 == lines_[l + 1].id)
      beside[1] = &lines_[l + 1];
    std::array<std::size_t, 2> nearest{beside[0] != nullptr ? beside[0]->begin : 0,
                                       beside[1] != nullptr ? beside[1]->begin : 0};

    for (std::size_t i = line.begin; i < line.end; ++i) {
      SweepPoint& point = points[i];
      Neighbourhood neighbourhood(point.position_base_m);
      for (std::size_t j = std::max(i, line.begin + 1) - 1; j < std::min(i + 2, line.end); ++j)
        neighbourhood.add(points[j].position_base_m);
      for (std::size_t side = 0; side < 2; ++side) {
        if (beside[side] == nullptr)
          continue;
        std::size_t& k = nearest[side];
        const auto time_apart = [&](std::size_t j) { return std::abs(points[j].age_s - point.age_s); };
        while (k + 1 < beside[side]->end && time_apart(k + 1) <= time_apart(k))
          ++k;
        for (std::size_t j = std::max(k, beside[side]->begin + 1) - 1; j < std::min(k + 2, beside[side]->end); ++j)
          neighbourhood.add(points[j].position_base_m);
      }
      point.normal_base = neighbourhood.normal();
    }
  }
}

} // namespace locus
