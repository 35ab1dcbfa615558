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

/// The odometry of locusd as a library: packets or clouds of lidars, IMU and odometry in, the pose of the robot out.
/// The same inputs give the same bits as locus-replay.
///
/// Stamps are nanoseconds since 1970, lengths metres, angles radians. The frame "odom" begins level where the robot
/// begins; "base" is that of the robot, x forward, z up. An object is for one thread at a time; different objects do
/// not know of each other. What a function throws is Error unless it says otherwise, and std::bad_alloc.
namespace liblocus {

/// What is wrong, where, and what to do: a line for each mistake, in the words of locus-replay.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
  ~Error() override;
};

enum class State : std::uint8_t {
  tracking,       ///< lidar tells all axes
  degenerate,     ///< lidar does not see some axis; the motion sources and the prediction tell it
  dead_reckoning, ///< the sweep was not registered; the pose is the prediction
  standstill,     ///< the robot stands
};
/// "tracking" and so on, as odometry.csv has it.
std::string_view name_of(State state);

/// What a motion source was to an estimate.
struct SourceEstimate {
  std::string name;                   ///< as configured
  std::array<double, 6> innovation{}; ///< m/s and rad/s along the axes of base: its motion less that of the others
  std::array<double, 6> innovation_sigma{}; ///< standard deviation that is expected of it; 0 before the first
  double test_ratio = 0;                    ///< above 1 it contradicts the rest
  std::int64_t last_used_ns = 0;            ///< end of the last sweep that used it; 0: never
  bool doubted = false;                     ///< it was not healthy
};

/// Where the robot is at the end of a sweep, and how sure that is.
struct Estimate {
  std::int64_t stamp_ns = 0;                 ///< end of the sweep
  std::array<double, 3> position_m{};        ///< of base in odom
  std::array<double, 4> orientation_xyzw{};  ///< unit quaternion, base to odom
  std::array<double, 36> pose_covariance{};  ///< row by row: x, y, z and turns about the axes of odom; since the start
  std::array<double, 6> twist{};             ///< m/s along and rad/s about x, y, z of base
  std::array<double, 36> twist_covariance{}; ///< of that, row by row
  State state = State::tracking;
  std::array<double, 6> observability{};   ///< how well lidar sees x, y, z, roll, pitch, yaw of base: 0 to 1
  std::string prior;                       ///< what the registration began from: "wio", "imu+wio", "identity"
  std::size_t points = 0;                  ///< that were registered
  std::size_t iterations = 0, inliers = 0; ///< of the registration with the map
  bool keyframe = false;                   ///< the map took this sweep
  bool failed = false;                     ///< the registration was refused: the pose is the prediction
  std::vector<SourceEstimate> sources;     ///< in the order of the configuration
};

/// A point, or a surface of the map.
struct Surface {
  std::array<float, 3> position_m{};
  std::array<float, 3> normal{}; ///< unit, or 0, 0, 0 where it is not known
};

/// The returns of a lidar as its driver gives them: rows of one turn or a part of it. The spans are read during the
/// call alone.
struct Cloud {
  std::int64_t stamp_ns = 0;             ///< what time_s counts from, by the clock of the lidar; 0: not known
  std::int64_t arrival_ns = 0;           ///< when it reached this computer
  std::span<const float> xyz_m;          ///< 3 n: x, y, z of each point, frame of the lidar
  std::span<const double> time_s{};      ///< n, since stamp_ns; or empty: not known
  std::span<const std::uint16_t> ring{}; ///< n, the laser of each point; or empty: told from the elevations
  std::span<const float> intensity{};    ///< n, 0 to 255; or empty
};

/// A reading of an inertial measurement unit, in its own frame.
struct ImuSample {
  std::int64_t stamp_ns = 0;   ///< of the measurement
  std::int64_t arrival_ns = 0; ///< when it reached this computer
  std::array<double, 3> angular_velocity_radps{};
  std::array<double, 3> specific_force_mps2{};             ///< +9.81 on z at rest and level
  std::optional<std::array<double, 4>> orientation_xyzw{}; ///< in a level frame of any heading, where the unit has one
};

/// A pose of a wheel, visual or kinematic odometry.
struct OdometrySample {
  std::int64_t stamp_ns = 0;                                  ///< of the measurement
  std::int64_t arrival_ns = 0;                                ///< when it reached this computer
  std::array<double, 3> position_m{};                         ///< of base in a frame of the source's own
  std::array<double, 4> orientation_xyzw{0.0, 0.0, 0.0, 1.0}; ///< unit quaternion, the same
  double covariance_scale = 1.0;                              ///< how much worse than usual the source says it is
};

/// An IPv4 address in host byte order, of text such as "192.168.1.201".
std::uint32_t parse_ip(std::string_view text);

/// Odometry of inputs that the caller feeds, in the order of their arrival, whatever clock that is told by. What is
/// late or double, or from a clock that was set, is treated and counted as by locus-replay: an input a little late
/// counts as it came, a jump of arrivals begins the sweeps anew. NaN and foreign packets are counted, and no error.
///
/// Each input returns the estimates of the sweeps that it completes: most often none, seldom more than one. Not to be
/// used after an exception other than Error.
class Odometry {
 public:
  /// `yaml_file` as locusd.yaml(5) describes it; empty: the defaults, one lidar on port 2368. `overrides` as --set of
  /// locus-replay, for example "lidars.front.model=VLP-16".
  explicit Odometry(const std::filesystem::path& yaml_file = {}, const std::vector<std::string>& overrides = {});
  ~Odometry();
  Odometry(Odometry&& other) noexcept;
  Odometry& operator=(Odometry&& other) noexcept;

  /// The payload of a UDP datagram; which lidar it is of is told by the port that it was sent to and, where that is
  /// configured, the address of the sender (host byte order; 0: not known).
  std::vector<Estimate> packet(std::span<const std::byte> payload, std::int64_t arrival_ns, std::uint16_t port = 2368,
                               std::uint32_t source_ip = 0);

  /// Of a lidar that the configuration gives a topic. An error for another lidar, and for spans of wrong length.
  std::vector<Estimate> cloud(std::string_view lidar, const Cloud& cloud);

  /// Of a motion source of kind imu. An error for another source.
  std::vector<Estimate> imu(std::string_view source, const ImuSample& sample);

  /// Of a motion source of kind odometry. An error for another source.
  std::vector<Estimate> odometry(std::string_view source, const OdometrySample& sample);

  /// Nothing more will come: the last sweep, if more than half of it is there. Whatever is fed afterwards is an error.
  std::vector<Estimate> finish();

  /// The points of the sweep processed last, corrected for motion: base frame at its end.
  [[nodiscard]] std::vector<Surface> scan() const;

  /// The map: a surface for each voxel of half a metre, frame odom.
  [[nodiscard]] std::vector<Surface> map() const;

  /// What was counted so far of packets, clouds, sources and sweeps: JSON as in summary.json of locus-replay.
  [[nodiscard]] std::string figures_json() const;

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

/// Which recording is replayed, and how.
struct ReplayOptions {
  std::filesystem::path yaml_file{};    ///< empty: that of the recording, or the defaults
  std::vector<std::string> overrides{}; ///< as --set of locus-replay
  std::chrono::nanoseconds start{};     ///< leaves out what arrived earlier, from the start of the recording
  std::optional<std::chrono::nanoseconds> duration{}; ///< leaves out what arrived this much later; nothing: to its end
};

/// Odometry of a recording: whatever locus-replay reads, a capture, a folder, a bag, MCAP, a drive of KITTI or a folder
/// of sweeps, with the IMU and odometry in it.
class Replay {
 public:
  explicit Replay(const std::filesystem::path& recording, const ReplayOptions& options = {});
  ~Replay();
  Replay(Replay&& other) noexcept;
  Replay& operator=(Replay&& other) noexcept;

  /// The estimate of the next sweep; nothing at the end. An error at the end of a recording without a packet or cloud
  /// that could be used, which tells why.
  std::optional<Estimate> next();

  /// What in the recording is unlikely to be what the user meant, a line each; at the end of it, more.
  [[nodiscard]] std::vector<std::string> warnings() const;

  /// As those of Odometry. The scan is that of the estimate given out last, unless one input completed several sweeps.
  [[nodiscard]] std::vector<Surface> scan() const;
  [[nodiscard]] std::vector<Surface> map() const;
  [[nodiscard]] std::string figures_json() const;

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

} // namespace liblocus
