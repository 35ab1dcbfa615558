// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

/// The odometry of locusd as a library: lidar packets or clouds, IMU and odometry in, the pose of the robot out.
/// The same inputs give the same bits as locus-replay.
///
/// Stamps are nanoseconds since 1970, lengths metres, angles radians. The frame "odom" is level and starts at the
/// robot's first pose; "base" is the frame of the robot, x forward, z up. An object may be used by one thread at a
/// time; objects are independent. Functions throw Error unless stated otherwise, and std::bad_alloc.
namespace liblocus {

/// The mistake, its location and the remedy: one line per mistake, in the words of locus-replay.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
  ~Error() override;
};

enum class State : std::uint8_t {
  tracking,       ///< lidar observes all axes
  degenerate,     ///< lidar does not observe some axis; motion sources and prediction determine it
  dead_reckoning, ///< the sweep was not registered; the pose is the prediction
  standstill,     ///< the robot is at rest
};
/// Returns the name as in odometry.csv, such as "tracking".
std::string_view name_of(State state);

/// Role of a motion source in an estimate.
struct SourceEstimate {
  std::string name;                   ///< as configured
  std::array<double, 6> innovation{}; ///< m/s and rad/s along the axes of base: its twist minus that of the others
  std::array<double, 6> innovation_sigma{}; ///< its predicted standard deviation; 0 before the first
  double test_ratio = 0;                    ///< above 1: inconsistent with the rest
  std::int64_t last_used_ns = 0;            ///< end of the last sweep that used it; 0: never
  bool doubted = false;                     ///< was not healthy
};

/// Pose of the robot at the end of a sweep, with its covariance.
struct Estimate {
  std::int64_t stamp_ns = 0;                 ///< end of the sweep
  std::array<double, 3> position_m{};        ///< of base in odom
  std::array<double, 4> orientation_xyzw{};  ///< unit quaternion, base to odom
  std::array<double, 36> pose_covariance{};  ///< row by row: x, y, z and turns about the axes of odom; since the start
  std::array<double, 6> twist{};             ///< m/s along and rad/s about x, y, z of base
  std::array<double, 36> twist_covariance{}; ///< of the twist, row by row
  State state = State::tracking;
  std::array<double, 6> observability{};   ///< observability by lidar of x, y, z, roll, pitch, yaw of base: 0 to 1
  std::string prior;                       ///< start of the registration: "wio", "imu+wio", "identity"
  std::size_t points = 0;                  ///< points registered
  std::size_t iterations = 0, inliers = 0; ///< of the registration with the map
  bool keyframe = false;                   ///< inserted into the map
  bool failed = false;                     ///< the registration was rejected: the pose is the prediction
  std::vector<SourceEstimate> sources;     ///< in configuration order
};

/// Point, or surface of the map.
struct Surface {
  std::array<float, 3> position_m{};
  std::array<float, 3> normal{}; ///< unit, or 0, 0, 0 if unknown
};

/// Returns of a lidar as published by its driver: rows of one turn or a part of it. The spans are read during the call
/// only.
struct Cloud {
  std::int64_t stamp_ns = 0;             ///< origin of time_s, by the clock of the lidar; 0: unknown
  std::int64_t arrival_ns = 0;           ///< reception time at this computer
  std::span<const float> xyz_m;          ///< 3 n: x, y, z of each point, frame of the lidar
  std::span<const double> time_s{};      ///< n, since stamp_ns; or empty: unknown
  std::span<const std::uint16_t> ring{}; ///< n, the laser of each point; or empty: derived from the elevations
  std::span<const float> intensity{};    ///< n, 0 to 255; or empty
};

/// Reading of an inertial measurement unit, in its own frame.
struct ImuSample {
  std::int64_t stamp_ns = 0;   ///< time of measurement
  std::int64_t arrival_ns = 0; ///< reception time at this computer
  std::array<double, 3> angular_velocity_radps{};
  std::array<double, 3> specific_force_mps2{};             ///< +9.81 on z at rest and level
  std::optional<std::array<double, 4>> orientation_xyzw{}; ///< in a level frame of any heading, if provided
};

/// Pose from a wheel, visual or kinematic odometry.
struct OdometrySample {
  std::int64_t stamp_ns = 0;                                  ///< time of measurement
  std::int64_t arrival_ns = 0;                                ///< reception time at this computer
  std::array<double, 3> position_m{};                         ///< of base in a frame specific to the source
  std::array<double, 4> orientation_xyzw{0.0, 0.0, 0.0, 1.0}; ///< unit quaternion, same frame
  double covariance_scale = 1.0; ///< covariance relative to the usual one, as reported by the source
};

/// Parses an IPv4 address such as "192.168.1.201" to host byte order.
std::uint32_t parse_ip(std::string_view text);

/// Odometry of inputs that the caller feeds in order of arrival, by any one clock. Late or duplicate inputs and clock
/// steps are treated and counted as by locus-replay: a slightly late input counts as fed; a jump of arrivals restarts
/// the sweeps. NaN and foreign packets are counted, not reported as errors.
///
/// Each input returns the estimates of the sweeps that it completes: usually none, rarely more than one. Must not be
/// used after an exception other than Error.
class Odometry {
 public:
  /// Loads `yaml_file`, see locusd.yaml(5); empty: the defaults, one lidar on port 2368. `overrides` as --set of
  /// locus-replay, for example "lidars.front.model=VLP-16".
  explicit Odometry(const std::filesystem::path& yaml_file = {}, const std::vector<std::string>& overrides = {});
  ~Odometry();
  Odometry(Odometry&& other) noexcept;
  Odometry& operator=(Odometry&& other) noexcept;

  /// Feeds the payload of a UDP datagram. The destination port identifies the lidar and, if configured, the sender's
  /// address (host byte order; 0: unknown).
  std::vector<Estimate> packet(std::span<const std::byte> payload, std::int64_t arrival_ns, std::uint16_t port = 2368,
                               std::uint32_t source_ip = 0);

  /// Feeds a cloud of a lidar that has a topic in the configuration. Throws for another lidar or spans of wrong length.
  std::vector<Estimate> cloud(std::string_view lidar, const Cloud& cloud);

  /// Feeds a sample of a motion source of kind imu. Throws for another source.
  std::vector<Estimate> imu(std::string_view source, const ImuSample& sample);

  /// Feeds a sample of a motion source of kind odometry. Throws for another source.
  std::vector<Estimate> odometry(std::string_view source, const OdometrySample& sample);

  /// Ends the input: completes the last sweep if more than half of it was received. Throws for any later input.
  std::vector<Estimate> finish();

  /// Returns the points of the last processed sweep, de-skewed: base frame at its end.
  [[nodiscard]] std::vector<Surface> scan() const;

  /// Returns the map: a surface for each voxel of half a metre, frame odom.
  [[nodiscard]] std::vector<Surface> map() const;

  /// Returns the counters of packets, clouds, sources and sweeps so far: JSON as in summary.json of locus-replay.
  [[nodiscard]] std::string figures_json() const;

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

/// Recording to replay, with settings.
struct ReplayOptions {
  std::filesystem::path yaml_file{};                  ///< empty: that of the recording, or the defaults
  std::vector<std::string> overrides{};               ///< as --set of locus-replay
  std::chrono::nanoseconds start{};                   ///< skips what arrived earlier, from the start of the recording
  std::optional<std::chrono::nanoseconds> duration{}; ///< skips what arrived this much later; nothing: to its end
};

/// Odometry of a recording in any format of locus-replay: a capture, a folder, a bag, MCAP, a drive of KITTI or a
/// folder of sweeps, with the IMU and odometry in it.
class Replay {
 public:
  explicit Replay(const std::filesystem::path& recording, const ReplayOptions& options = {});
  ~Replay();
  Replay(Replay&& other) noexcept;
  Replay& operator=(Replay&& other) noexcept;

  /// Returns the estimate of the next sweep; nothing at the end. Throws, with the reason, at the end of a recording
  /// without a usable packet or cloud.
  std::optional<Estimate> next();

  /// Returns suspicious properties of the recording, a line each; complete at its end.
  [[nodiscard]] std::vector<std::string> warnings() const;

  /// Same as in Odometry. The scan belongs to the estimate returned last, unless one input completed several sweeps.
  [[nodiscard]] std::vector<Surface> scan() const;
  [[nodiscard]] std::vector<Surface> map() const;
  [[nodiscard]] std::string figures_json() const;

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

} // namespace liblocus
