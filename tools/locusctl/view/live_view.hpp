// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <unordered_set>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json.hpp>

#include "core/base/pose.hpp"
#include "core/base/surface_point.hpp"
#include "core/map/surface_map.hpp"

namespace locus::tools {

/// Surfaces in the odom frame, one tile per voxel. Bounded: when it is full, its tiles grow by a quarter. One owner.
class TileMap {
 public:
  static constexpr std::size_t kMaxTiles = 150'000;
  static constexpr float kFinestTile_m = 0.25F;

  /// Adds a tile unless its voxel has one, or its point is not finite or without a normal. True if the tiles have been
  /// replaced by larger ones.
  bool add(const SurfacePoint& surface);
  void clear();

  [[nodiscard]] const std::vector<SurfacePoint>& tiles() const { return tiles_; } ///< in the order of add()
  [[nodiscard]] float tile_m() const { return tile_m_; }

 private:
  float tile_m_ = kFinestTile_m;
  std::vector<SurfacePoint> tiles_;
  std::unordered_set<std::uint64_t> voxels_; ///< keys of the tiles
};

/// Driven path in the odom frame. Bounded: when it is full, every other position is removed. One owner.
class DrivenPath {
 public:
  static constexpr std::size_t kMaxPositions = 20'000;
  static constexpr float kFinestStep_m = 0.05F; ///< exceeds the noise of a robot that stands

  /// Adds a position unless it is nearer than a step to the last one. True if positions have been removed.
  bool add(const Eigen::Vector3f& position_m);
  void clear();

  [[nodiscard]] const std::vector<Eigen::Vector3f>& positions_m() const { return positions_m_; }
  [[nodiscard]] double length_m() const { return length_m_; }

 private:
  float step_m_ = kFinestStep_m;
  std::vector<Eigen::Vector3f> positions_m_;
  double length_m_ = 0;
};

/// A processed sweep, as handed out by the service.
struct LiveSweep {
  std::int64_t run = 0;       ///< identifies the odom frame and its map
  std::uint64_t sequence = 0; ///< within a run
  Pose T_odom_base;
  std::vector<SurfacePoint> points_base;
};

/// Reads the newest sweep from the service's answer to `view`; empty if there is none yet, or if it is malformed.
std::optional<LiveSweep> read_sweep(const nlohmann::ordered_json& answer, std::span<const std::byte> bytes);

/// State of a robot as known from its service: map, path, newest sweep and status, for any number of pages. Memory is
/// bounded. Thread-safe.
class LiveView {
 public:
  static constexpr std::size_t kMaxSweepPoints = 20'000; ///< of the newest sweep; evenly thinned above
  static constexpr std::size_t kTilesPerAnswer = 20'000;

  /// `first_epoch` must differ between runs of the program.
  explicit LiveView(std::int64_t first_epoch) : epoch_(first_epoch) {}

  void set_status(nlohmann::ordered_json status);
  /// Shows why there is no new status; the rest remains.
  void set_problem(std::string problem);
  /// Adds a sweep unless it is the last one again. True if it is the first of its run: add_map() is then of use.
  bool add(const LiveSweep& sweep);
  /// Adds the planes of the service's map, one per voxel of SurfaceMap::kFineLeaf_m, with normals of either direction.
  void add_map(std::span<const SurfacePoint> planes_odom);

  /// Parts of a page's picture. Those of another epoch are void.
  struct Known {
    std::int64_t epoch = 0;
    std::size_t tiles = 0, positions = 0; ///< number of first ones that the page has
    std::uint64_t sequence = 0;           ///< of its sweep
  };
  /// Returns what a page lacks, at most kTilesPerAnswer tiles at once.
  ///
  /// Little-endian: the length of the JSON as uint32, the JSON, blanks up to a multiple of four bytes, then the records
  /// counted by the JSON: tiles (x y z as float32 and the normal, octahedral() and two zero bytes), positions of the
  /// path (x y z as float32), points of the newest sweep (likewise). All in the odom frame, in metres.
  [[nodiscard]] std::string answer(const Known& known) const;

 private:
  void begin_run(std::int64_t run);

  mutable std::mutex mutex_;
  std::int64_t epoch_; ///< changes when tiles or positions that were handed out are void
  nlohmann::ordered_json status_;
  std::string problem_ = "connecting to the service";
  TileMap map_;
  DrivenPath path_;
  std::optional<std::int64_t> run_;
  std::uint64_t sequence_ = 0, missed_sweeps_ = 0;
  Pose T_odom_base_;
  std::vector<Eigen::Vector3f> sweep_odom_;
};

} // namespace locus::tools
