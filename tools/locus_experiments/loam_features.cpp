// SPDX-License-Identifier: Apache-2.0
#include "locus_experiments/loam_features.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <span>
#include <vector>

namespace locus::experiments {
namespace {

constexpr std::size_t kSide = 5;         ///< neighbours on either side
constexpr std::size_t kQuarters = 4;     ///< LOAM's identical subregions
constexpr std::size_t kEdges = 20;       ///< per quarter: ten times 2
constexpr std::size_t kPlanes = 40;      ///< ten times 4
constexpr float kEdgeCurvature = 0.005F; ///< a corner of 90 degrees has 0.007, a wall with 1 cm of noise 0.001
constexpr float kOccluded = 0.1F;        ///< step of the range between neighbours, as a share of it
constexpr float kAlongBeam = 0.02F;      ///< the same on either side: the surface lies along the beam
constexpr float kSpacing_m = 0.25F;      ///< a chosen point rules out its neighbours up to a gap this wide

using Line = std::span<const SweepPoint>;

class LineFeatures {
 public:
  explicit LineFeatures(Line line) : line_(line), ruled_out_(line.size(), false), curvature_(line.size(), 0.0F) {
    for (std::size_t i = kSide; i + kSide < line_.size(); ++i) {
      curvature_[i] = curvature(i);
      if (lies_along_beam(i))
        ruled_out_[i] = true;
      rule_out_occluded(i);
    }
  }

  void choose(std::vector<SweepPoint>& chosen) {
    if (line_.size() < 2 * kSide + kQuarters)
      return;
    const std::size_t inner = line_.size() - 2 * kSide;
    for (std::size_t quarter = 0; quarter < kQuarters; ++quarter)
      choose(kSide + quarter * inner / kQuarters, kSide + (quarter + 1) * inner / kQuarters, chosen);
  }

 private:
  [[nodiscard]] float range(std::size_t i) const { return line_[i].position_base_m.norm(); }

  [[nodiscard]] float curvature(std::size_t i) const {
    Eigen::Vector3f sum = Eigen::Vector3f::Zero();
    for (std::size_t j = i - kSide; j <= i + kSide; ++j)
      sum += line_[i].position_base_m - line_[j].position_base_m;
    return sum.norm() / (2.0F * kSide * range(i));
  }

  [[nodiscard]] bool lies_along_beam(std::size_t i) const {
    const float before = std::abs(range(i - 1) - range(i)), after = std::abs(range(i + 1) - range(i));
    return before > kAlongBeam * range(i) && after > kAlongBeam * range(i);
  }

  /// Excludes the farther side of a range step, whose edge is only the shadow of the nearer surface.
  void rule_out_occluded(std::size_t i) {
    const float here = range(i), next = range(i + 1);
    if (here - next > kOccluded * here)
      std::fill_n(ruled_out_.begin() + static_cast<std::ptrdiff_t>(i - kSide), kSide + 1, true);
    else if (next - here > kOccluded * next)
      std::fill_n(ruled_out_.begin() + static_cast<std::ptrdiff_t>(i + 1), kSide, true);
  }

  void choose(std::size_t begin, std::size_t end, std::vector<SweepPoint>& chosen) {
    std::vector<std::size_t> by_curvature(end - begin);
    std::iota(by_curvature.begin(), by_curvature.end(), begin);
    std::ranges::sort(by_curvature, {}, [this](std::size_t i) { return curvature_[i]; });
    std::size_t edges = 0, planes = 0;
    for (auto i = by_curvature.rbegin(); i != by_curvature.rend() && edges < kEdges && is_edge(*i); ++i)
      edges += select(*i, chosen);
    for (auto i = by_curvature.begin(); i != by_curvature.end() && planes < kPlanes && !is_edge(*i); ++i)
      planes += select(*i, chosen);
  }

  [[nodiscard]] bool is_edge(std::size_t i) const { return curvature_[i] > kEdgeCurvature; }

  std::size_t select(std::size_t i, std::vector<SweepPoint>& chosen) {
    if (ruled_out_[i])
      return 0;
    chosen.push_back(line_[i]);
    ruled_out_[i] = true;
    for (std::size_t j = i + 1; j <= i + kSide && adjoin(j - 1, j); ++j)
      ruled_out_[j] = true;
    for (std::size_t j = i; j-- > i - kSide && adjoin(j, j + 1);)
      ruled_out_[j] = true;
    return 1;
  }

  [[nodiscard]] bool adjoin(std::size_t i, std::size_t j) const {
    return (line_[i].position_base_m - line_[j].position_base_m).norm() < kSpacing_m;
  }

  Line line_;
  std::vector<bool> ruled_out_;
  std::vector<float> curvature_;
};

} // namespace

void keep_loam_features(Sweep& sweep) {
  std::ranges::stable_sort(sweep.points, [](const SweepPoint& a, const SweepPoint& b) {
    return a.scan_line != b.scan_line ? a.scan_line < b.scan_line : a.age_s > b.age_s;
  });
  std::vector<SweepPoint> chosen;
  for (auto begin = sweep.points.begin(); begin != sweep.points.end();) {
    const auto end = std::find_if(begin, sweep.points.end(),
                                  [&](const SweepPoint& point) { return point.scan_line != begin->scan_line; });
    LineFeatures(Line{begin, end}).choose(chosen);
    begin = end;
  }
  sweep.points.assign(chosen.begin(), chosen.end());
  sweep.registered = sweep.points.size();
}

} // namespace locus::experiments
