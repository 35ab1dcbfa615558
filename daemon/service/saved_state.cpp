// SPDX-License-Identifier: Apache-2.0
#include "daemon/service/saved_state.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <span>
#include <string_view>
#include <system_error>
#include <type_traits>

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

namespace locus::daemon {

namespace {

constexpr double kInSight_m = 60.0;

constexpr std::array<char, 8> kMagic{'l', 'o', 'c', 'u', 's', 'd', ' ', '2'};

/// What the file begins with, as the machine holds it: it is read where it was written.
struct Head {
  std::array<char, 8> magic;
  std::int64_t stamp_ns;
  std::array<double, 7> xyz_xyzw;
  std::array<double, 6> twist;
  std::uint64_t checksum; ///< of what stands above
};

/// What follows, and is followed by the points.
struct Body {
  std::int32_t flat_ground;
  std::uint32_t points;
  std::uint64_t checksum; ///< of what stands above, and of the points
};
static_assert(std::has_unique_object_representations_v<Body> && sizeof(SurfacePoint) == 6 * sizeof(float));

template <class Block> std::string_view bytes_of(const Block& block) {
  return {reinterpret_cast<const char*>(&block), sizeof(block)};
}

/// FNV-1a: a file cut short or mixed up is to be noticed, not a forged one.
std::uint64_t checksum_of(std::string_view bytes, std::uint64_t hash = 0xcbf29ce484222325U) {
  for (const char byte : bytes)
    hash = (hash ^ static_cast<unsigned char>(byte)) * 0x100000001b3U;
  return hash;
}

std::uint64_t checksum_of(const Head& head) { return checksum_of(bytes_of(head).substr(0, offsetof(Head, checksum))); }

std::uint64_t checksum_of(const Body& body, std::string_view points) {
  return checksum_of(points, checksum_of(bytes_of(body).substr(0, offsetof(Body, checksum))));
}

/// A disk that is full takes part of what is written, and says why only when it is asked for the rest.
bool write_all(int descriptor, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = write(descriptor, bytes.data(), bytes.size());
    if (written < 0 && errno != EINTR)
      return false;
    bytes.remove_prefix(static_cast<std::size_t>(std::max<ssize_t>(written, 0)));
  }
  return true;
}

Head head_of(const Whereabouts& last) {
  Head head{kMagic, to_ns(last.stamp), {}, {}, 0};
  const auto& p = last.T_odom_base.translation;
  const auto& q = last.T_odom_base.rotation;
  head.xyz_xyzw = {p.x(), p.y(), p.z(), q.x(), q.y(), q.z(), q.w()};
  Eigen::Map<Vector6>(head.twist.data()) = last.twist_base;
  head.checksum = checksum_of(head);
  return head;
}

std::string to_bytes(const SavedState& state) {
  const Head head = head_of(state.last);
  Body body{static_cast<std::int32_t>(state.flat_ground), static_cast<std::uint32_t>(state.map_odom.size()), 0};
  const auto points = std::as_bytes(std::span(state.map_odom));
  const std::string_view text{reinterpret_cast<const char*>(points.data()), points.size()};
  body.checksum = checksum_of(body, text);
  return std::string{bytes_of(head)}.append(bytes_of(body)).append(text);
}

/// Whether a robot can go on from there: what another hand wrote may hold anything.
bool makes_sense(const SavedState& state) {
  constexpr double kFarthest_m = 1e8; // geocentric coordinates are within it
  if (state.last.stamp < Stamp{})
    return false;
  const auto [rotation, translation] = state.last.carried_to(Stamp::max());
  return rotation.norm() > 0.5 && translation.norm() < kFarthest_m && // false for NaN
         std::ranges::all_of(state.map_odom, [](const SurfacePoint& point) {
           return point.position_m.cast<double>().norm() < kFarthest_m && point.normal.allFinite();
         });
}

/// Nothing if it is cut short or damaged.
std::optional<SavedState> from_bytes(std::string_view bytes) {
  Head head{};
  Body body{};
  if (bytes.size() < sizeof(head) + sizeof(body))
    return std::nullopt;
  std::memcpy(&head, bytes.data(), sizeof(head));
  std::memcpy(&body, bytes.data() + sizeof(head), sizeof(body));
  const std::string_view points = bytes.substr(sizeof(head) + sizeof(body));
  if (head.magic != kMagic || head.checksum != checksum_of(head) || body.checksum != checksum_of(body, points) ||
      points.size() != body.points * sizeof(SurfacePoint) || body.flat_ground < 0 ||
      body.flat_ground > static_cast<std::int32_t>(FlatGround::automatic))
    return std::nullopt;
  SavedState state;
  const auto& v = head.xyz_xyzw;
  state.last.stamp = stamp_from_ns(head.stamp_ns);
  state.last.T_odom_base = {Eigen::Quaterniond(v[6], v[3], v[4], v[5]).normalized(), {v[0], v[1], v[2]}};
  state.last.twist_base = Eigen::Map<const Vector6>(head.twist.data());
  state.flat_ground = static_cast<FlatGround>(body.flat_ground);
  state.map_odom.resize(body.points);
  if (body.points > 0)
    std::memcpy(std::as_writable_bytes(std::span(state.map_odom)).data(), points.data(), points.size());
  return makes_sense(state) ? std::optional(std::move(state)) : std::nullopt;
}

} // namespace

Whereabouts Whereabouts::followed_by(const OdometryEstimate& estimate) const {
  constexpr double kMemory_s = 0.3;
  const double elapsed_s = to_seconds(estimate.stamp - stamp);
  const double share = elapsed_s > 0.0 ? 1.0 - std::exp(-elapsed_s / kMemory_s) : 1.0;
  constexpr double kUnsure = 0.1; ///< m/s and rad/s, one standard deviation: of such a twist one half is taken
  const Vector6 unsureness = estimate.twist_covariance.diagonal() / (kUnsure * kUnsure);
  const Vector6 news = share * (estimate.twist_base - twist_base).array() / (1.0 + unsureness.array());
  return {estimate.stamp, estimate.T_odom_base, twist_base + news};
}

Pose Whereabouts::carried_to(Stamp now) const {
  constexpr Duration kMoment = std::chrono::seconds{2};
  return T_odom_base * se3_exp(to_seconds(std::clamp(now - stamp, Duration::zero(), kMoment)) * twist_base);
}

void read_map(const Odometry& odometry, const Pose& T_odom_base, std::vector<SurfacePoint>& map_odom) {
  read_planes(odometry.map().fine(), map_odom, T_odom_base.translation, kInSight_m);
}

std::optional<std::string> write_state(const std::filesystem::path& file, const SavedState& state) {
  const std::filesystem::path beside = file.string() + ".new";
  const std::string bytes = to_bytes(state);
  const int descriptor = open(beside.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  const bool written = descriptor >= 0 && write_all(descriptor, bytes) && fsync(descriptor) == 0;
  const int error = errno;
  if (descriptor >= 0)
    close(descriptor);
  if (written && rename(beside.c_str(), file.c_str()) == 0)
    return std::nullopt;
  const std::string why = std::strerror(written ? errno : error); // NOLINT(concurrency-mt-unsafe)
  unlink(beside.c_str());
  return fmt::format("{}: the state cannot be saved ({}); after a restart the odometry begins anew", file.string(),
                     why);
}

Expected<SavedState, std::string> load_state(const std::filesystem::path& file) {
  std::ifstream stream{file, std::ios::binary};
  if (!stream)
    return fmt::format("{}: there is none", file.string());
  const std::string bytes{std::istreambuf_iterator<char>{stream}, {}};
  std::optional<SavedState> state = from_bytes(bytes);
  if (!state)
    return fmt::format("{}: is cut short or damaged", file.string());
  return std::move(*state);
}

void update_whereabouts(const std::filesystem::path& file, const Whereabouts& last) {
  const Head head = head_of(last);
  const int descriptor = open(file.c_str(), O_WRONLY | O_CLOEXEC);
  if (descriptor < 0)
    return;
  static_cast<void>(write_all(descriptor, bytes_of(head)));
  close(descriptor);
}

std::optional<std::filesystem::path> state_path() {
  const char* const folder = std::getenv("STATE_DIRECTORY"); // NOLINT(concurrency-mt-unsafe): nobody sets it
  return folder != nullptr ? std::optional{std::filesystem::path(folder) / "state"} : std::nullopt;
}

/// A clock that was set back does not put it off.
bool StateKeeper::is_due() const {
  return !saved_ || std::chrono::abs(now_->stamp - saved_->stamp) > kEvery ||
         (now_->T_odom_base.translation - saved_->T_odom_base.translation).norm() > kEvery_m;
}

void StateKeeper::begin_anew(const std::optional<SavedState>& start) {
  now_.reset();
  saved_.reset();
  written_.reset();
  static_cast<void>(states_.take()); // of the time before
  static_cast<void>(whereabouts_.take());
  std::error_code error;
  if (file_ && start) {
    if (const auto problem = write_state(*file_, *start))
      complain_(*problem);
  } else if (file_ && !std::filesystem::remove(*file_, error) && error) {
    complain_(fmt::format("{}: cannot be removed ({}); a restart within a minute goes on from it", file_->string(),
                          error.message()));
  }
}

void StateKeeper::take(const Odometry& odometry, const OdometryEstimate& estimate, FlatGround flat_ground) {
  now_ = now_.value_or(Whereabouts{}).followed_by(estimate);
  if (!file_ || (!saved_ && estimate.failed))
    return;
  if (!estimate.failed && is_due()) {
    saved_ = now_;
    Due& due = states_.back();
    due.number = ++number_;
    due.state.last = *now_;
    due.state.flat_ground = flat_ground;
    read_map(odometry, now_->T_odom_base, due.state.map_odom);
    static_cast<void>(states_.publish()); // an older one that was not written yet is worth nothing any more
  }
  whereabouts_.back() = {number_, *now_};
  static_cast<void>(whereabouts_.publish());
}

/// The whereabouts are taken first: the state that they belong to is then there, or has been written.
void StateKeeper::write() {
  const Update* const update = whereabouts_.take();
  if (const Due* const due = states_.take()) {
    const auto problem = write_state(*file_, due->state);
    written_ = problem ? std::nullopt : std::optional{due->number};
    if (problem)
      complain_(*problem);
  }
  if (update != nullptr && update->number == written_)
    update_whereabouts(*file_, update->last);
}

} // namespace locus::daemon
