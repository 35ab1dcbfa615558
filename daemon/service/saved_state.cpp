// SPDX-License-Identifier: Apache-2.0
#include "daemon/service/saved_state.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <span>
#include <string_view>
#include <type_traits>

#include <fcntl.h>
#include <fmt/format.h>
#include <pthread.h>
#include <unistd.h>

namespace locus::daemon {

namespace {

constexpr double kInSight_m = 60.0;

/// What the file begins with, as the machine holds it: it is read where it was written.
struct Header {
  std::array<char, 8> magic;
  std::int64_t stamp_ns;
  std::int32_t flat_ground;
  std::uint32_t points;
  std::array<double, 7> xyz_xyzw;
  std::uint64_t checksum; ///< of the rest, with zero here
};
constexpr std::array<char, 8> kMagic{'l', 'o', 'c', 'u', 's', 'd', ' ', '1'};
static_assert(std::is_trivially_copyable_v<Header> && sizeof(SurfacePoint) == 6 * sizeof(float));

/// FNV-1a: a file cut short or mixed up is to be noticed, not a forged one.
std::uint64_t checksum_of(const std::string& bytes) {
  std::uint64_t hash = 0xcbf29ce484222325U;
  for (const char byte : bytes)
    hash = (hash ^ static_cast<unsigned char>(byte)) * 0x100000001b3U;
  return hash;
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

std::string to_bytes(const SavedState& state) {
  const Pose& T = state.start.T_odom_base;
  const auto& p = T.translation;
  const auto& q = T.rotation;
  Header header{kMagic,
                to_ns(state.stamp),
                static_cast<std::int32_t>(state.flat_ground),
                static_cast<std::uint32_t>(state.start.map_odom.size()),
                {p.x(), p.y(), p.z(), q.x(), q.y(), q.z(), q.w()},
                0};
  std::string bytes(sizeof(header) + state.start.map_odom.size() * sizeof(SurfacePoint), '\0');
  std::memcpy(bytes.data(), &header, sizeof(header));
  if (header.points > 0) // NOLINTNEXTLINE(bugprone-undefined-memory-manipulation): six floats, but for Eigen's word
    std::memcpy(bytes.data() + sizeof(header), state.start.map_odom.data(), bytes.size() - sizeof(header));
  header.checksum = checksum_of(bytes);
  std::memcpy(bytes.data(), &header, sizeof(header));
  return bytes;
}

} // namespace

void read_state(const Odometry& odometry, const OdometryEstimate& estimate, SavedState& state) {
  state.stamp = estimate.stamp;
  state.start.T_odom_base = estimate.T_odom_base;
  state.start.map_odom.clear();
  const SurfaceGrid& grid = odometry.map().fine();
  for (std::size_t slot = 0; slot < grid.size(); ++slot) {
    const Surface& surface = grid.surface(slot);
    const Eigen::Vector3d point = grid.centre(slot) + surface.mean_m.cast<double>();
    if (surface.planar() && (point - estimate.T_odom_base.translation).norm() < kInSight_m)
      state.start.map_odom.push_back({point.cast<float>(), surface.normal});
  }
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
  std::string bytes{std::istreambuf_iterator<char>{stream}, {}};
  Header header{};
  const auto broken = [&] { return fmt::format("{}: is cut short or damaged", file.string()); };
  if (bytes.size() < sizeof(header))
    return broken();
  std::memcpy(&header, bytes.data(), sizeof(header));
  const std::uint64_t checksum = std::exchange(header.checksum, 0);
  std::memcpy(bytes.data(), &header, sizeof(header));
  if (header.magic != kMagic || bytes.size() != sizeof(header) + header.points * sizeof(SurfacePoint) ||
      checksum != checksum_of(bytes) || header.flat_ground < 0 ||
      header.flat_ground > static_cast<std::int32_t>(FlatGround::automatic))
    return broken();
  SavedState state;
  state.stamp = stamp_from_ns(header.stamp_ns);
  state.flat_ground = static_cast<FlatGround>(header.flat_ground);
  const auto& v = header.xyz_xyzw;
  state.start.T_odom_base = {Eigen::Quaterniond(v[6], v[3], v[4], v[5]).normalized(), {v[0], v[1], v[2]}};
  state.start.map_odom.resize(header.points);
  if (header.points > 0)
    std::memcpy(std::as_writable_bytes(std::span(state.start.map_odom)).data(), bytes.data() + sizeof(header),
                header.points * sizeof(SurfacePoint));
  return state;
}

std::optional<std::filesystem::path> state_path() {
  const char* const folder = std::getenv("STATE_DIRECTORY"); // NOLINT(concurrency-mt-unsafe): nobody sets it
  return folder != nullptr ? std::optional{std::filesystem::path(folder) / "state"} : std::nullopt;
}

StateKeeper::StateKeeper(std::optional<std::filesystem::path> file, Complain complain)
    : file_(std::move(file)), complain_(std::move(complain)) {
  if (!file_)
    return;
  thread_ = std::thread([this] { run(); });
  pthread_setname_np(thread_.native_handle(), "state");
}

StateKeeper::~StateKeeper() {
  stopping_.store(true, std::memory_order_relaxed);
  wakeup_.notify();
  if (thread_.joinable())
    thread_.join();
}

void StateKeeper::take(const Odometry& odometry, const OdometryEstimate& estimate, FlatGround flat_ground) {
  const bool due = !last_ || estimate.stamp - last_->stamp > kEvery ||
                   (estimate.T_odom_base.translation - last_->T_odom_base.translation).norm() > kEvery_m;
  if (!file_ || estimate.failed || !due)
    return;
  last_ = estimate;
  read_state(odometry, estimate, slot_.back());
  slot_.back().flat_ground = flat_ground;
  static_cast<void>(slot_.publish()); // an older one that was not written yet is worth nothing any more
  wakeup_.notify();
}

void StateKeeper::run() {
  while (!stopping_.load(std::memory_order_relaxed)) {
    wakeup_.wait_for(std::chrono::milliseconds{500});
    const SavedState* state = slot_.take();
    if (state == nullptr)
      continue;
    if (const auto problem = write_state(*file_, *state))
      complain_(*problem);
  }
}

} // namespace locus::daemon
