// SPDX-License-Identifier: Apache-2.0
// Lower bounds of the cost of each stage: touches each byte once; looks up each point of a registration once and
// accumulates it.
#include <algorithm>
#include <array>
#include <cstring>
#include <memory>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "core/base/isa.hpp"
#include "core/map/surface_grid.hpp"
#include "suite.hpp"

namespace locus::performance {

namespace {

/// Reads every byte, eight at a time.
std::uint64_t touch(std::span<const std::byte> bytes) {
  std::uint64_t sum = 0;
  for (std::size_t at = 0; at + sizeof sum <= bytes.size(); at += sizeof sum) {
    std::uint64_t word;
    std::memcpy(&word, &bytes[at], sizeof word);
    sum += word;
  }
  return sum;
}

/// Touches the packets of each sweep in turn.
void touch_packets(benchmark::State& state, const Capture& capture, std::size_t sweeps) {
  std::vector<std::span<const std::byte>> payloads;
  for (const daemon::Input& input : capture.inputs())
    if (const auto* datagram = std::get_if<Datagram>(&input))
      payloads.push_back(datagram->payload);
  const std::size_t per_sweep = payloads.size() / sweeps;
  std::size_t sweep = 0;
  for (auto _ : state) {
    for (const auto payload : std::span(payloads).subspan(sweep * per_sweep, per_sweep))
      benchmark::DoNotOptimize(touch(payload));
    sweep = (sweep + 1) % sweeps;
  }
}

using SweepPoints = std::vector<std::vector<SweepPoint>>;

void touch_points(benchmark::State& state, const SweepPoints& sweeps) {
  std::size_t sweep = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(touch(std::as_bytes(std::span(sweeps[sweep]))));
    sweep = (sweep + 1) % sweeps.size();
  }
}

/// Points as structure of arrays, so that loops over them are vectorised.
constexpr std::size_t kBlock = 256;
template <class T> using PerPoint = std::array<T, kBlock>;
struct Block {
  PerPoint<float> x{}, y{}, z{};
};
struct Cells {
  PerPoint<std::int32_t> x, y, z;
};
struct Planes {
  PerPoint<float> nx, ny, nz, offset; ///< zero normal: no plane
};

/// Upper half of the 6x6 normal equations of point-to-plane, their right side and the squared error.
constexpr std::size_t kSums = 21 + 6 + 1;
constexpr std::size_t kLanes = 16;
using Sums = std::array<std::array<float, kLanes>, kSums>;

/// Transformed points, relative to the map's origin.
struct Placed {
  Block points;
  Cells cells;
};

/// Transforms the points and computes the voxel of each.
[[gnu::always_inline]] inline Placed place(const Eigen::Matrix3f& R, const Eigen::Vector3f& t, float per_m,
                                           const Block& points) {
  const auto cell = [](float voxels) {
    const auto truncated = static_cast<std::int32_t>(voxels);
    return truncated - static_cast<std::int32_t>(voxels < static_cast<float>(truncated));
  };
  const float r00 = R(0, 0), r01 = R(0, 1), r02 = R(0, 2), r10 = R(1, 0), r11 = R(1, 1), r12 = R(1, 2), r20 = R(2, 0),
              r21 = R(2, 1), r22 = R(2, 2), tx = t.x(), ty = t.y(), tz = t.z();
  const Block p = points; // a local copy rules out aliasing
  Placed placed;
  for (std::size_t i = 0; i < kBlock; ++i) {
    const float x = r00 * p.x[i] + r01 * p.y[i] + r02 * p.z[i] + tx;
    const float y = r10 * p.x[i] + r11 * p.y[i] + r12 * p.z[i] + ty;
    const float z = r20 * p.x[i] + r21 * p.y[i] + r22 * p.z[i] + tz;
    placed.points.x[i] = x;
    placed.points.y[i] = y;
    placed.points.z[i] = z;
    placed.cells.x[i] = cell(x * per_m + 0.5F);
    placed.cells.y[i] = cell(y * per_m + 0.5F);
    placed.cells.z[i] = cell(z * per_m + 0.5F);
  }
  return placed;
}

void look_up(const SurfaceGrid& grid, const Cells& cells, Planes& planes) {
  std::array<VoxelIndex, kBlock> indices;
  std::array<const Surface*, kBlock> surfaces;
  for (std::size_t i = 0; i < kBlock; ++i)
    indices[i] = {cells.x[i], cells.y[i], cells.z[i]};
  grid.find(indices, surfaces);
  const auto leaf_m = static_cast<float>(grid.leaf_m());
  for (std::size_t i = 0; i < kBlock; ++i) {
    const bool planar = surfaces[i] != nullptr && surfaces[i]->planar();
    const Eigen::Vector3f n = planar ? surfaces[i]->normal : Eigen::Vector3f::Zero();
    const Eigen::Vector3f centre_m = leaf_m * Eigen::Vector3i{indices[i].x, indices[i].y, indices[i].z}.cast<float>();
    planes.nx[i] = n.x();
    planes.ny[i] = n.y();
    planes.nz[i] = n.z();
    planes.offset[i] = planar ? n.dot(centre_m + surfaces[i]->mean_m) : 0.0F;
  }
}

[[gnu::always_inline]] inline void sum_up(const Block& p, const Planes& plane, Sums& total) {
  constexpr std::size_t kColumns = 7; // of J, and the residual
  Sums sums = total;
  for (std::size_t begin = 0; begin < kBlock; begin += kLanes) {
    std::array<std::array<float, kLanes>, kColumns> J;
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      const std::size_t i = begin + lane;
      const float x = p.x[i], y = p.y[i], z = p.z[i];
      const float nx = plane.nx[i], ny = plane.ny[i], nz = plane.nz[i];
      J[0][lane] = nx;
      J[1][lane] = ny;
      J[2][lane] = nz;
      J[3][lane] = y * nz - z * ny;
      J[4][lane] = z * nx - x * nz;
      J[5][lane] = x * ny - y * nx;
      J[6][lane] = nx * x + ny * y + nz * z - plane.offset[i];
    }
    std::size_t sum = 0;
    for (std::size_t row = 0; row < kColumns; ++row)
      for (std::size_t column = row; column < kColumns; ++column, ++sum)
        for (std::size_t lane = 0; lane < kLanes; ++lane)
          sums[sum][lane] += J[row][lane] * J[column][lane];
  }
  total = sums;
}

/// The registered points of the last sweep of a capture, and their registration target.
class LastSweep {
 public:
  explicit LastSweep(const Capture& capture) : playback_(capture, capture.config()) {
    while (const daemon::ProcessedSweep* sweep = playback_.next()) {
      T_map_base_ = sweep->estimate.T_odom_base;
      points_ = sweep->estimate.points;
    }
    const auto scan = playback_.pipeline().odometry().scan().first(points_);
    blocks_.resize((points_ + kBlock - 1) / kBlock);
    for (std::size_t i = 0; i < points_; ++i) {
      blocks_[i / kBlock].x[i % kBlock] = scan[i].position_m.x();
      blocks_[i / kBlock].y[i % kBlock] = scan[i].position_m.y();
      blocks_[i / kBlock].z[i % kBlock] = scan[i].position_m.z();
    }
  }

  /// Looks up every point in the fine grid and accumulates it.
  [[nodiscard]] Sums pass(Isa isa) const {
    const SurfaceGrid& grid = playback_.pipeline().odometry().map().fine();
    const Eigen::Matrix3f R = T_map_base_.R().cast<float>();
    const Eigen::Vector3f t = T_map_base_.translation.cast<float>();
    const auto per_m = static_cast<float>(1.0 / grid.leaf_m());
    Placed placed;
    Planes planes;
    Sums sums{};
    for (const Block& block : blocks_) {
      run_as(isa, [&] { placed = place(R, t, per_m, block); });
      look_up(grid, placed.cells, planes);
      run_as(isa, [&] { sum_up(placed.points, planes, sums); });
    }
    return sums;
  }
  [[nodiscard]] std::size_t points() const { return points_; }

 private:
  Playback playback_;
  Pose T_map_base_;
  std::size_t points_ = 0;
  std::vector<Block> blocks_;
};

void look_up_and_sum(benchmark::State& state, const LastSweep& sweep) {
  const Isa isa = best_isa();
  for (auto _ : state)
    benchmark::DoNotOptimize(sweep.pass(isa));
  state.counters["points"] = static_cast<double>(sweep.points());
}

} // namespace

void add_floors(const Effort& effort, const Capture& capture) {
  const auto last_sweep = std::make_shared<const LastSweep>(capture);
  const auto sweeps = std::make_shared<SweepPoints>();
  Playback playback(capture, capture.config());
  while (playback.next() != nullptr)
    sweeps->push_back(playback.pipeline().points());
  add("floor_packets/" + capture.name(), effort, 10 * sweeps->size(),
      [&capture, sweeps](auto& state) { touch_packets(state, capture, sweeps->size()); });
  add("floor_points/" + capture.name(), effort, 10 * sweeps->size(),
      [sweeps](auto& state) { touch_points(state, *sweeps); });
  add("floor_pass/" + capture.name(), effort, 1000, [last_sweep](auto& state) { look_up_and_sum(state, *last_sweep); });
}

} // namespace locus::performance
