// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/sweep.hpp"

namespace locus {

/// Gathers returns into short arcs of their scan line as they come in: a downsampling that needs no hash and no search.
///
/// A segment ends where it has grown longer than the leaf or where the range jumps to another surface. The leaf follows
/// the scene from sweep to sweep so that about as many segments come out as were asked for. Memory is fixed at
/// construction.
/// One owner.
class RingSegments {
 public:
  static constexpr std::size_t kMaxSegments = 65536;
  static constexpr std::uint32_t kNone = 0xFFFFFFFFU;

  RingSegments(std::size_t lidars, std::size_t points_wanted);

  /// Takes in a return and gives back the segment it went into, kNone when all are in use. `time_s` counts from the
  /// start of the sweep.
  std::uint32_t add(std::uint16_t scan_line, const Eigen::Vector3f& position_m, float range_m, float time_s,
                    float intensity);

  /// Writes the centroids sorted by scan line, in it by time, with age_s = duration_s - time; steers the leaf and
  /// starts over.  /// After it place_of() tells where a segment went: kNone for one that went round a corner and was
  /// left out.
  void finish(float duration_s, std::vector<SweepPoint>& points);
  [[nodiscard]] std::uint32_t place_of(std::uint32_t segment) const { return place_[segment]; }

 private:
  struct Segment {
    Eigen::Vector3f first_m, last_m;
    Eigen::Vector3f sum_m;
    float time_sum_s;
    float intensity_sum;
    float count;
    std::uint16_t scan_line;
  };
  struct Line {
    std::uint32_t open = kNone;
    float last_range_m = 0.0F;
  };

  static bool bends(const Segment& segment);

  std::size_t points_wanted_;
  float leaf_m_;
  std::vector<Line> lines_; ///< by scan line
  std::vector<Segment> segments_;
  std::vector<std::uint32_t> place_;
  std::vector<std::uint32_t> line_begin_;
};

} // namespace locus
