// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/scene_tree.hpp"

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <utility>
#include <variant>

namespace locus::sim {
namespace {

constexpr double kFar_m = 1e30;   // beyond any ray
constexpr float kSlack_m = 1e-3F; // margin of boxes, above the error of single precision

Bounds bounds_of(const Surface& surface) {
  return std::visit([](const auto& shape) { return shape.bounds(); }, surface.shape);
}

const Bounds kOutOfReach{Eigen::Vector3d::Constant(kFar_m), Eigen::Vector3d::Constant(kFar_m)};
const Bounds kNoBounds{Eigen::Vector3d::Constant(kNowhere), Eigen::Vector3d::Constant(-kNowhere)}; // empty union

double area_m2(const Bounds& bounds) {
  const Eigen::Vector3d size = bounds.max_m - bounds.min_m;
  return size.x() * size.y() + size.y() * size.z() + size.z() * size.x();
}

/// Sorts surfaces into a bounding volume hierarchy.
class TreeMaker {
 public:
  TreeMaker(std::vector<Surface>& surfaces, std::vector<TreeNode>& nodes) : surfaces_(surfaces), nodes_(nodes) {
    for (const Surface& surface : surfaces) {
      order_.push_back(static_cast<std::uint32_t>(order_.size()));
      bounds_.push_back(bounds_of(surface));
      middles_m_.emplace_back((bounds_.back().min_m + bounds_.back().max_m) / 2);
    }
  }

  void make() {
    if (!surfaces_.empty())
      node_over(0, order_.size());
    std::vector<Surface> sorted;
    std::transform(order_.begin(), order_.end(), std::back_inserter(sorted),
                   [&](std::uint32_t i) { return surfaces_[i]; });
    surfaces_ = std::move(sorted);
  }

 private:
  struct Bin { // surfaces with centres in one slice of a range
    Bounds box = kNoBounds;
    std::size_t count = 0;

    void add(const Bin& other) {
      box = united(box, other.box);
      count += other.count;
    }
    [[nodiscard]] double cost() const { return count == 0 ? 0 : static_cast<double>(count) * area_m2(box); }
  };
  struct Cut { // surfaces with centres below it go to one side
    Eigen::Index axis = 0;
    double at_m = 0, cost = kNowhere;
  };

  std::uint32_t node_over(std::size_t begin, std::size_t end) {
    const std::size_t middle = split(begin, end);
    const std::array<std::size_t, 5> limits{begin, split(begin, middle), middle, split(middle, end), end};
    TreeNode node;
    node.child.fill(kSurface); // also for an empty lane, whose box is out of reach
    for (std::size_t lane = 0; lane < 4; ++lane) {
      const std::size_t from = limits[lane], to = limits[lane + 1];
      const Bounds box = bounds_over(from, to);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const auto i = static_cast<Eigen::Index>(axis), j = static_cast<Eigen::Index>(lane);
        node.min_m[axis][j] = static_cast<float>(box.min_m[i]) - kSlack_m;
        node.max_m[axis][j] = static_cast<float>(box.max_m[i]) + kSlack_m;
      }
      if (from != to)
        node.child[lane] = to - from == 1 ? kSurface | static_cast<std::uint32_t>(from) : node_over(from, to);
    }
    nodes_.push_back(node);
    return static_cast<std::uint32_t>(nodes_.size() - 1);
  }

  [[nodiscard]] Bounds bounds_over(std::size_t begin, std::size_t end) const {
    Bounds all = begin == end ? kOutOfReach : kNoBounds;
    for (std::size_t i = begin; i < end; ++i)
      all = united(all, bounds_[order_[i]]);
    return all;
  }

  /// Splits a range in two at the least expected cost; the probability to hit a box is proportional to its area.
  std::size_t split(std::size_t begin, std::size_t end) {
    if (end - begin < 2)
      return end;
    Bounds middles = kNoBounds;
    for (std::size_t i = begin; i < end; ++i)
      middles = united(middles, {middles_m_[order_[i]], middles_m_[order_[i]]});
    Cut best;
    for (const Eigen::Index axis : {0, 1, 2}) {
      const Cut cut = cheapest_cut(begin, end, axis, middles);
      if (cut.cost < best.cost)
        best = cut;
    }
    if (best.cost == kNowhere) // all centres coincide
      return begin + (end - begin) / 2;
    const auto at = [&](std::size_t place) { return order_.begin() + static_cast<std::ptrdiff_t>(place); };
    const auto middle = std::stable_partition(at(begin), at(end),
                                              [&](std::uint32_t i) { return middles_m_[i][best.axis] < best.at_m; });
    return static_cast<std::size_t>(middle - order_.begin());
  }

  [[nodiscard]] Cut cheapest_cut(std::size_t begin, std::size_t end, Eigen::Index axis, const Bounds& middles) const {
    const double low_m = middles.min_m[axis], slice_m = (middles.max_m[axis] - low_m) / static_cast<double>(kBins);
    Cut best{.axis = axis};
    if (!(slice_m > 1e-6))
      return best;
    std::array<Bin, kBins> bins;
    for (std::size_t i = begin; i < end; ++i) {
      const auto bin = static_cast<std::size_t>((middles_m_[order_[i]][axis] - low_m) / slice_m);
      bins[std::min(bin, kBins - 1)].add({bounds_[order_[i]], 1});
    }
    std::array<double, kBins> cost_behind;
    Bin behind, before;
    for (std::size_t i = kBins; i-- > 0;) {
      behind.add(bins[i]);
      cost_behind[i] = behind.cost();
    }
    for (std::size_t i = 1; i < kBins; ++i) {
      before.add(bins[i - 1]);
      if (const double cost = before.cost() + cost_behind[i]; cost < best.cost)
        best = {axis, low_m + static_cast<double>(i) * slice_m, cost};
    }
    return best;
  }

  static constexpr std::size_t kBins = 16;

  std::vector<Surface>& surfaces_;
  std::vector<TreeNode>& nodes_;
  std::vector<std::uint32_t> order_;
  std::vector<Bounds> bounds_; ///< in input order, like the next
  std::vector<Eigen::Vector3d> middles_m_;
};

} // namespace

std::vector<TreeNode> make_tree(std::vector<Surface>& surfaces) {
  std::vector<TreeNode> nodes;
  TreeMaker(surfaces, nodes).make();
  return nodes;
}

Bounds bounds_of(std::span<const Surface> surfaces) {
  Bounds all = surfaces.empty() ? kOutOfReach : kNoBounds;
  for (const Surface& surface : surfaces)
    all = united(all, bounds_of(surface));
  return all;
}

} // namespace locus::sim
