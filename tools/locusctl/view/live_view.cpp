// SPDX-License-Identifier: Apache-2.0
#include "locusctl/view/live_view.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <utility>

#include "accuracy/voxel_key.hpp"
#include "pages/octahedral.hpp"

namespace locus::tools {
namespace {

using nlohmann::ordered_json;

static_assert(std::endian::native == std::endian::little, "the records are written as they are in memory");

void append(std::string& bytes, const Eigen::Vector3f& position_m) {
  bytes.append(reinterpret_cast<const char*>(position_m.data()), 3 * sizeof(float));
}

void append(std::string& bytes, const SurfacePoint& tile) {
  append(bytes, tile.position_m);
  const auto [u, v] = octahedral(tile.normal);
  const std::array<char, 4> normal{static_cast<char>(u), static_cast<char>(v), 0, 0};
  bytes.append(normal.data(), normal.size());
}

/// Returns the JSON with its length before it and blanks after it.
std::string header_of(const ordered_json& json) {
  std::string text = json.dump(-1, ' ', false, ordered_json::error_handler_t::replace);
  text.append((4 - text.size() % 4) % 4, ' ');
  const auto size = static_cast<std::uint32_t>(text.size());
  std::string bytes(sizeof(size), '\0');
  std::memcpy(bytes.data(), &size, sizeof(size));
  return bytes + text;
}

} // namespace

bool TileMap::add(const SurfacePoint& surface) {
  constexpr float kCoarser = 1.25F;
  if (!surface.position_m.allFinite() || !(surface.normal.squaredNorm() > 0.0F) ||
      !voxels_.insert(voxel_key(surface.position_m, tile_m_)).second)
    return false;
  tiles_.push_back(surface);
  if (tiles_.size() <= kMaxTiles)
    return false;
  while (tiles_.size() > kMaxTiles) {
    tile_m_ *= kCoarser;
    voxels_.clear();
    std::erase_if(tiles_, [this](const SurfacePoint& tile) {
      return !voxels_.insert(voxel_key(tile.position_m, tile_m_)).second;
    });
  }
  return true;
}

void TileMap::clear() { *this = TileMap{}; }

bool DrivenPath::add(const Eigen::Vector3f& position_m) {
  if (!positions_m_.empty()) {
    const float moved_m = (position_m - positions_m_.back()).norm();
    if (!(moved_m >= step_m_))
      return false;
    length_m_ += static_cast<double>(moved_m);
  }
  positions_m_.push_back(position_m);
  if (positions_m_.size() <= kMaxPositions)
    return false;
  step_m_ *= 2;
  for (std::size_t i = 0; 2 * i < positions_m_.size(); ++i)
    positions_m_[i] = positions_m_[2 * i];
  positions_m_.resize((positions_m_.size() + 1) / 2);
  return true;
}

void DrivenPath::clear() { *this = DrivenPath{}; }

std::optional<LiveSweep> read_sweep(const ordered_json& answer, std::span<const std::byte> bytes) {
  try {
    const ordered_json& json = answer.at("sweep");
    const auto xyz = json.at("xyz_m").get<std::array<double, 3>>();
    const auto q = json.at("quaternion_xyzw").get<std::array<double, 4>>();
    LiveSweep sweep{
        json.at("run"), json.at("sequence"), {}, std::vector<SurfacePoint>(bytes.size() / sizeof(SurfacePoint))};
    sweep.T_odom_base = {Eigen::Quaterniond{q[3], q[0], q[1], q[2]}, {xyz[0], xyz[1], xyz[2]}};
    if (!sweep.T_odom_base.finite())
      return std::nullopt;
    if (!sweep.points_base.empty())
      std::memcpy(std::as_writable_bytes(std::span(sweep.points_base)).data(), bytes.data(),
                  sweep.points_base.size() * sizeof(SurfacePoint));
    return sweep;
  } catch (const nlohmann::json::exception&) {
    return std::nullopt;
  }
}

void LiveView::set_status(ordered_json status) {
  const std::scoped_lock lock(mutex_);
  status_ = std::move(status);
  problem_.clear();
}

void LiveView::set_problem(std::string problem) {
  const std::scoped_lock lock(mutex_);
  problem_ = std::move(problem);
}

bool LiveView::add(const LiveSweep& sweep) {
  const std::scoped_lock lock(mutex_);
  const bool is_first = run_ != sweep.run;
  if (is_first)
    begin_run(sweep.run);
  else if (sweep.sequence <= sequence_)
    return false;
  else
    missed_sweeps_ += sweep.sequence - sequence_ - 1;
  sequence_ = sweep.sequence;
  T_odom_base_ = sweep.T_odom_base;
  const Eigen::Matrix3f R = T_odom_base_.R().cast<float>();
  const Eigen::Vector3f t = T_odom_base_.translation.cast<float>();
  bool is_replaced = path_.add(t);
  sweep_odom_.clear();
  const std::size_t step = sweep.points_base.size() / kMaxSweepPoints + 1;
  for (std::size_t i = 0; i < sweep.points_base.size(); ++i) {
    const SurfacePoint& point = sweep.points_base[i];
    const SurfacePoint in_odom{R * point.position_m + t, R * point.normal};
    is_replaced = map_.add(in_odom) || is_replaced;
    if (i % step == 0 && in_odom.position_m.allFinite())
      sweep_odom_.push_back(in_odom.position_m);
  }
  epoch_ += is_replaced ? 1 : 0;
  return is_first;
}

void LiveView::begin_run(std::int64_t run) {
  run_ = run;
  ++epoch_;
  map_.clear();
  path_.clear();
  missed_sweeps_ = 0;
}

/// Covers each plane by four tiles, which face the height of a lidar above the robot.
void LiveView::add_map(std::span<const SurfacePoint> planes_odom) {
  constexpr float kQuarter_m = static_cast<float>(SurfaceMap::kFineLeaf_m) / 4;
  const Eigen::Vector3f kAboveRobot_m{0, 0, 0.75F};
  const std::scoped_lock lock(mutex_);
  const Eigen::Vector3f viewpoint = T_odom_base_.translation.cast<float>() + kAboveRobot_m;
  bool is_replaced = false;
  for (const SurfacePoint& plane : planes_odom) {
    const bool faces_away = (viewpoint - plane.position_m).dot(plane.normal) < 0.0F;
    const Eigen::Vector3f normal = faces_away ? -plane.normal : plane.normal;
    const Eigen::Vector3f along = kQuarter_m * normal.unitOrthogonal(), across = normal.cross(along);
    for (const float a : {-1.0F, 1.0F})
      for (const float b : {-1.0F, 1.0F})
        is_replaced = map_.add({plane.position_m + a * along + b * across, normal}) || is_replaced;
  }
  epoch_ += is_replaced ? 1 : 0;
}

std::string LiveView::answer(const Known& known) const {
  const std::scoped_lock lock(mutex_);
  const bool is_current = known.epoch == epoch_;
  const std::size_t tile = is_current ? std::min(known.tiles, map_.tiles().size()) : 0;
  const std::size_t position = is_current ? std::min(known.positions, path_.positions_m().size()) : 0;
  const bool has_sweep = is_current && known.sequence == sequence_;
  const auto tiles = std::span(map_.tiles()).subspan(tile).first(std::min(map_.tiles().size() - tile, kTilesPerAnswer));
  const auto positions = std::span(path_.positions_m()).subspan(position);
  const auto points = std::span(sweep_odom_).first(has_sweep ? 0 : sweep_odom_.size());
  ordered_json json{{"epoch", epoch_},
                    {"problem", problem_},
                    {"tiles",
                     {{"from", tile},
                      {"count", tiles.size()},
                      {"total", map_.tiles().size()},
                      {"max", TileMap::kMaxTiles},
                      {"side_m", map_.tile_m()}}},
                    {"path",
                     {{"from", position},
                      {"count", positions.size()},
                      {"max", DrivenPath::kMaxPositions},
                      {"length_m", path_.length_m()}}},
                    {"status", status_}};
  if (run_) {
    const Pose& T = T_odom_base_;
    json["sweep"] = {{"sequence", sequence_},
                     {"missed", missed_sweeps_},
                     {"count", points.size()},
                     {"xyz_m", {T.translation.x(), T.translation.y(), T.translation.z()}},
                     {"quaternion_xyzw", {T.rotation.x(), T.rotation.y(), T.rotation.z(), T.rotation.w()}}};
  }
  std::string bytes = header_of(json);
  for (const SurfacePoint& one : tiles)
    append(bytes, one);
  for (const Eigen::Vector3f& one : positions)
    append(bytes, one);
  for (const Eigen::Vector3f& one : points)
    append(bytes, one);
  return bytes;
}

} // namespace locus::tools
