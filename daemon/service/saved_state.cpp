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
#include <type_traits>

#include <Eigen/Eigenvalues>
#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

namespace locus::daemon {

namespace {

constexpr double kMapRadius_m = 60.0;

constexpr std::array<char, 8> kMagic{'l', 'o', 'c', 'u', 's', 'd', ' ', '8'};

using LearnedNumbers = std::array<double, 6 + LearnedSource::kMostStates*(LearnedSource::kMostStates + 1)>;

constexpr std::string_view kAnyVersion = "locusd ";

/// Header of the file, stored twice, in native byte order since the file stays on one machine. An update overwrites the
/// older copy in place, so one copy is valid at any time; of two valid copies the newer counts.
struct Head {
  std::array<char, 8> magic;
  std::uint64_t number; ///< consecutive
  std::int64_t stamp_ns;
  std::array<double, 7> xyz_xyzw;
  std::array<double, 36> covariance;
  std::array<double, 6> twist;
  std::array<std::array<double, 7>, kMaxSources> sources_xyz_xyzw; ///< all zero: empty
  std::array<LearnedNumbers, kMaxSources> learned;                 ///< noise, states, covariance; zero noise: empty
  std::array<std::int64_t, kMaxSources> learned_since_ns;
  std::uint64_t doubted;  ///< one bit per source
  std::uint64_t checksum; ///< over all members above
};

constexpr std::size_t kHeads = 2;

/// Part of the file between the headers and the points.
struct Body {
  SourceIds sources;
  std::int32_t flat_ground;
  std::uint32_t points;
  std::uint64_t checksum; ///< over all members above and the points
};
static_assert(std::has_unique_object_representations_v<Body> && sizeof(SurfacePoint) == 6 * sizeof(float));

template <class Block> std::string_view bytes_of(const Block& block) {
  return {reinterpret_cast<const char*>(&block), sizeof(block)};
}

/// Computes FNV-1a, to detect truncation or corruption, not forgery.
std::uint64_t checksum_of(std::string_view bytes, std::uint64_t hash = 0xcbf29ce484222325U) {
  for (const char byte : bytes)
    hash = (hash ^ static_cast<unsigned char>(byte)) * 0x100000001b3U;
  return hash;
}

std::uint64_t checksum_of(const Head& head) { return checksum_of(bytes_of(head).substr(0, offsetof(Head, checksum))); }

std::uint64_t checksum_of(const Body& body, std::string_view points) {
  return checksum_of(points, checksum_of(bytes_of(body).substr(0, offsetof(Body, checksum))));
}

/// Writes all bytes; false on error. A full disk first accepts a part and reports the error on the next call.
bool write_all(int descriptor, std::string_view bytes, std::size_t offset = 0) {
  while (!bytes.empty()) {
    const ssize_t written = pwrite(descriptor, bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (written < 0 && errno != EINTR)
      return false;
    bytes.remove_prefix(static_cast<std::size_t>(std::max<ssize_t>(written, 0)));
    offset += static_cast<std::size_t>(std::max<ssize_t>(written, 0));
  }
  return true;
}

/// Syncs a folder, so that a rename in it survives a power cut. Ignores errors of file systems without support.
void sync_folder(const std::filesystem::path& folder) {
  const int descriptor = open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0)
    return;
  fsync(descriptor);
  close(descriptor);
}

std::array<double, 7> to_numbers(const Pose& pose) {
  const auto& p = pose.translation;
  const auto& q = pose.rotation;
  return {p.x(), p.y(), p.z(), q.x(), q.y(), q.z(), q.w()};
}

Pose to_pose(const std::array<double, 7>& v) {
  return {Eigen::Quaterniond(v[6], v[3], v[4], v[5]).normalized(), {v[0], v[1], v[2]}};
}

LearnedNumbers to_numbers(const LearnedSource& learned) {
  LearnedNumbers numbers;
  Eigen::Map<Vector6>{numbers.data()} = learned.noise_per_s;
  Eigen::Map<LearnedSource::States>{&numbers[6]} = learned.states;
  Eigen::Map<LearnedSource::Covariance>{&numbers[6 + LearnedSource::kMostStates]} = learned.covariance;
  return numbers;
}

LearnedSource to_learned(const LearnedNumbers& numbers) {
  return {.noise_per_s = Eigen::Map<const Vector6>{numbers.data()},
          .states = Eigen::Map<const LearnedSource::States>{&numbers[6]},
          .covariance = Eigen::Map<const LearnedSource::Covariance>{&numbers[6 + LearnedSource::kMostStates]}
                            .selfadjointView<Eigen::Lower>()};
}

Head head_of(const ResumeState& last, std::uint64_t number) {
  Head head{.magic = kMagic,
            .number = number,
            .stamp_ns = to_ns(last.stamp),
            .xyz_xyzw = to_numbers(last.T_odom_base),
            .covariance = {},
            .twist = {},
            .sources_xyz_xyzw = {},
            .learned = {},
            .learned_since_ns = {},
            .doubted = last.doubted.to_ullong(),
            .checksum = 0};
  Eigen::Map<Matrix6>(head.covariance.data()) = last.pose_covariance;
  Eigen::Map<Vector6>(head.twist.data()) = last.twist_base;
  for (std::size_t i = 0; i < kMaxSources; ++i) {
    if (last.T_source_base[i])
      head.sources_xyz_xyzw[i] = to_numbers(*last.T_source_base[i]);
    if (last.learned[i])
      head.learned[i] = to_numbers(*last.learned[i]);
    head.learned_since_ns[i] = last.learned[i] ? to_ns(last.learned[i]->since) : 0;
  }
  head.checksum = checksum_of(head);
  return head;
}

std::string to_bytes(const SavedState& state) {
  Body body{state.sources, static_cast<std::int32_t>(state.flat_ground),
            static_cast<std::uint32_t>(state.map_odom.size()), 0};
  const auto points = std::as_bytes(std::span(state.map_odom));
  const std::string_view text{reinterpret_cast<const char*>(points.data()), points.size()};
  body.checksum = checksum_of(body, text);
  std::string bytes;
  for (std::uint64_t number = 0; number < kHeads; ++number)
    bytes += bytes_of(head_of(state.last, number));
  return bytes.append(bytes_of(body)).append(text);
}

/// Newest valid header and the offset of the other one.
struct NewestHead {
  Head head;
  std::size_t offset_of_older;
};

/// Returns the newest valid header, if any; `bytes` is the beginning of the file.
std::optional<NewestHead> newest_head(std::string_view bytes) {
  std::optional<NewestHead> newest;
  for (std::size_t index = 0; index < kHeads && bytes.size() >= (index + 1) * sizeof(Head); ++index) {
    Head head{};
    std::memcpy(&head, bytes.data() + index * sizeof(Head), sizeof(Head));
    if (head.magic == kMagic && head.checksum == checksum_of(head) && (!newest || head.number > newest->head.number))
      newest = {head, (kHeads - 1 - index) * sizeof(Head)};
  }
  return newest;
}

/// Checks that a matrix is finite and positive semidefinite; any size is valid, as after minutes of dead reckoning.
template <class Matrix> bool is_covariance(const Matrix& matrix) {
  constexpr double kRounding = 1e-6;
  const double size = matrix.norm();
  return std::isfinite(size) &&
         (matrix.template selfadjointView<Eigen::Lower>().eigenvalues().array() > -kRounding * (1.0 + size)).all();
}

/// Checks a learned calibration for plausible values; one learned from a faulty source is discarded.
bool is_plausible(const LearnedSource& learned) {
  constexpr double kMin = -0.9, kMax = 1.5; // bias in rad/s, delay in s, mounting in rad, scale - 1
  return (learned.noise_per_s.array() > 0.0).all() && learned.noise_per_s.allFinite() &&
         (learned.states.array() > kMin && learned.states.array() < kMax).all() && is_covariance(learned.covariance);
}

/// Checks that a state is usable, since the file may contain arbitrary values.
bool is_plausible(const SavedState& state) {
  constexpr double kMaxDistance_m = 1e8; // geocentric coordinates are within it
  if (state.last.stamp < Stamp{})
    return false;
  const auto is_valid = [](const Pose& pose) {
    return pose.rotation.norm() > 0.5 && pose.translation.norm() < kMaxDistance_m; // false for NaN
  };
  return is_valid(state.last.extrapolated_to(Stamp::max())) && is_covariance(state.last.pose_covariance) &&
         std::ranges::all_of(state.last.T_source_base, [&](const auto& pose) { return !pose || is_valid(*pose); }) &&
         std::ranges::all_of(state.map_odom, [](const SurfacePoint& point) {
           return point.position_m.cast<double>().norm() < kMaxDistance_m && point.normal.allFinite();
         });
}

/// Parses a state; empty if the file is truncated or damaged.
std::optional<SavedState> from_bytes(std::string_view bytes) {
  constexpr std::size_t kBodyOffset = kHeads * sizeof(Head), kPointsOffset = kBodyOffset + sizeof(Body);
  const std::optional<NewestHead> newest = newest_head(bytes);
  if (!newest || bytes.size() < kPointsOffset)
    return std::nullopt;
  const Head& head = newest->head;
  Body body{};
  std::memcpy(&body, bytes.data() + kBodyOffset, sizeof(body));
  const std::string_view points = bytes.substr(kPointsOffset);
  if (body.checksum != checksum_of(body, points) || points.size() != body.points * sizeof(SurfacePoint) ||
      body.flat_ground < 0 || body.flat_ground > static_cast<std::int32_t>(FlatGround::automatic))
    return std::nullopt;
  SavedState state;
  state.last.stamp = stamp_from_ns(head.stamp_ns);
  state.last.T_odom_base = to_pose(head.xyz_xyzw);
  state.last.pose_covariance = Eigen::Map<const Matrix6>(head.covariance.data()).selfadjointView<Eigen::Lower>();
  for (std::size_t i = 0; i < kMaxSources; ++i) {
    if (const auto& stored = head.sources_xyz_xyzw[i]; stored != decltype(stored){})
      state.last.T_source_base[i] = to_pose(stored);
    if (const LearnedSource learned = to_learned(head.learned[i]); is_plausible(learned))
      state.last.learned[i].emplace(learned).since = stamp_from_ns(head.learned_since_ns[i]);
  }
  state.last.doubted = head.doubted;
  state.sources = body.sources;
  state.last.twist_base = Eigen::Map<const Vector6>(head.twist.data());
  state.flat_ground = static_cast<FlatGround>(body.flat_ground);
  state.map_odom.resize(body.points);
  if (body.points > 0)
    std::memcpy(std::as_writable_bytes(std::span(state.map_odom)).data(), points.data(), points.size());
  return is_plausible(state) ? std::optional(std::move(state)) : std::nullopt;
}

} // namespace

SourceIds ids_of(std::span<const MotionSource> sources) {
  SourceIds ids{.list = checksum_of("")};
  for (std::size_t i = 0; i < sources.size(); ++i) {
    const MotionSource& source = sources[i];
    ids.list = checksum_of(fmt::format("{} {} {}\n", source.name, to_string(source.kind), source.topic), ids.list);
    const Eigen::Quaterniond& q = source.T_base_source.rotation;
    const CalibrationSigma& sigma = source.calibration_sigma;
    ids.configured[i] = checksum_of(
        fmt::format("{} {} {} {} {} {} {} {} {} {} {} {}", source.late_ms, source.scale, source.yaw_scale, q.w(), q.x(),
                    q.y(), q.z(), to_string(source.calibration), sigma.late_ms.value_or(-1.0),
                    sigma.mounting_deg.value_or(-1.0), sigma.scale.value_or(-1.0), sigma.yaw_scale.value_or(-1.0)));
  }
  return ids;
}

void SavedState::reset_changed_sources(const SourceIds& now) {
  if (sources.list != now.list)
    last.drop_sources();
  for (std::size_t i = 0; i < kMaxSources; ++i)
    if (sources.configured[i] != now.configured[i])
      last.learned[i].reset();
}

void read_map(const Odometry& odometry, const Pose& T_odom_base, std::vector<SurfacePoint>& map_odom) {
  read_planes(odometry.map().fine(), map_odom, T_odom_base.translation, kMapRadius_m);
}

std::optional<std::string> write_state(const std::filesystem::path& file, const SavedState& state) {
  const std::filesystem::path new_file = file.string() + ".new";
  const std::string bytes = to_bytes(state);
  const int descriptor = open(new_file.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  const bool written = descriptor >= 0 && write_all(descriptor, bytes) && fsync(descriptor) == 0;
  const int error = errno;
  if (descriptor >= 0)
    close(descriptor);
  if (written && rename(new_file.c_str(), file.c_str()) == 0) {
    sync_folder(file.parent_path());
    return std::nullopt;
  }
  const std::string why = std::strerror(written ? errno : error); // NOLINT(concurrency-mt-unsafe)
  unlink(new_file.c_str());
  return fmt::format(
      "{}: the state cannot be saved ({}); make its folder writable for locusd, or a restart begins at the origin",
      file.string(), why);
}

Expected<SavedState, std::string> load_state(const std::filesystem::path& file) {
  std::ifstream stream{file, std::ios::binary};
  if (!stream)
    return fmt::format("{}: cannot be opened", file.string());
  const std::string bytes{std::istreambuf_iterator<char>{stream}, {}};
  if (bytes.starts_with(kAnyVersion) && !bytes.starts_with(std::string_view{kMagic.data(), kMagic.size()}))
    return fmt::format("{}: was written by another version", file.string());
  std::optional<SavedState> state = from_bytes(bytes);
  if (!state)
    return fmt::format("{}: is truncated or damaged", file.string());
  return std::move(*state);
}

void update_resume_state(const std::filesystem::path& file, const ResumeState& last) {
  const int descriptor = open(file.c_str(), O_RDWR | O_CLOEXEC);
  if (descriptor < 0)
    return;
  std::array<char, kHeads * sizeof(Head)> heads{};
  const ssize_t read = pread(descriptor, heads.data(), heads.size(), 0);
  const std::string_view bytes{heads.data(), static_cast<std::size_t>(std::max<ssize_t>(read, 0))};
  if (const auto newest = newest_head(bytes))
    static_cast<void>(write_all(descriptor, bytes_of(head_of(last, newest->head.number + 1)), newest->offset_of_older));
  close(descriptor);
}

std::optional<std::filesystem::path> state_path() {
  const char* const folder = std::getenv("STATE_DIRECTORY"); // NOLINT(concurrency-mt-unsafe): never set here
  return folder != nullptr ? std::optional{std::filesystem::path(folder) / "state"} : std::nullopt;
}

} // namespace locus::daemon
