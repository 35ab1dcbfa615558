// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include "config/config.hpp"
#include "config/sha256.hpp"
#include "core/ingest/sweep.hpp"
#include "daemon/incidents.hpp"
#include "daemon/ingest.hpp"
#include "daemon/odometry_comparison.hpp"
#include "daemon/recorder.hpp"
#include "daemon/sweep_processor.hpp"

namespace locus::daemon {

/// Snapshot of the ingest's counters for other threads. Plain memory.
struct IngestReport {
  /// State of the CloudDecoder of a lidar that publishes clouds.
  struct Clouds {
    CloudCounters counters;
    CloudDoubts doubts;
    std::array<Stamp, kCloudDoubts> last_doubted{};
    PointTiming timing{};
    RingsFrom rings{};
    Duration period{};
  };
  struct Lidar {
    PacketCounters packets;
    std::optional<Clouds> clouds{};      ///< empty for a lidar that sends packets
    std::string_view model, return_mode; ///< from LidarInput; empty before the first valid packet
    double rotation_rate_rpm = 0.0;
    std::optional<std::uint32_t> source_ip;        ///< host byte order
    std::optional<std::uint32_t> refused_ip;       ///< LidarSender::rejected_ip()
    OtherSenders other_senders;                    ///< LidarSender::others()
    std::optional<UnknownPackets> unknown_packets; ///< PacketDecoder::unknown_packets()
    Stamp last_received;                           ///< LidarSender::last_received()
    Stamp unknown_last_received;                   ///< LidarInput::unknown_last_received()
    std::string_view pps = "absent";               ///< LidarInput::clock_state()
    std::string_view pps_unused{};                 ///< LidarInput::why_pps_is_unused()
    bool has_date = false;                         ///< PacketDecoder::has_date()
    std::uint64_t packets_of_other_mode = 0; ///< ouster::Decoder::packets_of_other_start() where is_in_other_mode()

    static Lidar of(const LidarInput& lidar);
    void add(const CloudDecoder& decoder);

    /// Return counts of data packets or clouds.
    [[nodiscard]] std::uint64_t used() const { return clouds ? clouds->counters.used : packets.data; }
    [[nodiscard]] std::uint64_t received() const { return clouds ? clouds->counters.received : packets.received; }
  };
  struct Source {
    SourceCounters counters;
    bool healthy = false;
    Stamp last_received;                   ///< HealthMonitor::last_received()
    std::string_view verdict;              ///< text with static lifetime; see HealthMonitor
    std::optional<Duration> slow_period{}; ///< of an IMU for which HealthMonitor::is_too_slow() holds
    Refusal refusal{};                     ///< HealthMonitor::refusal(); default: none
    Refusal longest_refusal{};
    std::optional<Eigen::Matrix3d> gyro_axes{}; ///< HealthMonitor::gyro_axes()
  };

  PacketCounters total;
  std::array<Lidar, kMaxLidars> lidars;    ///< by index
  std::array<Source, kMaxSources> sources; ///< by index
  SweepBuilder::Counters sweeps;

  /// Copies the counters. Ingest thread.
  void read(const Ingest& ingest);
  /// Tells whether any lidar has sent usable data.
  [[nodiscard]] bool has_lidar_data() const {
    return std::ranges::any_of(lidars, [](const Lidar& lidar) { return lidar.used() > 0; });
  }
};

/// Reports another sender, possibly a second lidar, on the port of a lidar without configured address, with a
/// configuration that separates the two. Empty while the number of rejected packets is negligible.
std::optional<std::string> shared_port(const LidarOptions& options, const IngestReport::Lidar& lidar);

/// Reports packets of an unsupported model on a lidar's port, with their description. Empty while their number is
/// negligible.
std::optional<std::string> unknown_model(const LidarOptions& options, const IngestReport::Lidar& lidar);

/// Describes the faults in the times of a lidar's clouds, one line each.
std::vector<std::string> cloud_doubts(const LidarOptions& options, const IngestReport::Lidar& lidar);

/// Reports a locked PPS whose time is not used, with the reason; empty otherwise.
std::optional<std::string> unused_pps(const LidarOptions& options, const IngestReport::Lidar& lidar);

/// Reports an Ouster that was restarted after its metadata was fetched and now runs in another mode, so that its
/// packets are rejected; empty otherwise.
std::optional<std::string> stale_metadata(const LidarOptions& options, const IngestReport::Lidar& lidar);

/// Warns of a sweep period shorter than one revolution of the lidar; empty otherwise.
std::optional<std::string> short_sweep(const SweepOptions& options, const std::string& lidar, double rotation_rate_rpm);

/// Warns of estimates above the configured maximum speed; empty otherwise.
std::optional<std::string> too_fast(const MotionLimits& limits, double largest_speed_mps);

/// Names of the axes of a pose, twist or observability, by index.
inline constexpr std::array<std::string_view, 6> kAxes{"x", "y", "z", "roll", "pitch", "yaw"};

/// Percentiles of a distribution.
struct Percentiles {
  double p50 = 0, p90 = 0, p99 = 0, max = 0;
};

/// Cumulative histogram of the processing times of all sweeps.
struct LatencyHistogram {
  /// Upper bounds, chosen for deadlines of one revolution (50 to 200 ms) and processing times from 1 ms.
  static constexpr std::array<double, 9> kBounds_s{0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5};

  std::array<std::uint64_t, kBounds_s.size() + 1> counts{}; ///< by bound; the last counts values above all bounds
  double sum_s = 0;

  void add(double duration_s);
};

/// Statistics of the processed sweeps: sums since the start, distributions of the latest ones.
struct SweepFigures {
  std::uint64_t sweeps = 0;
  double raw_points = 0, filtered_points = 0, scan_to_scan_iterations = 0, scan_to_submap_iterations = 0;
  /// Number of sweeps whose prior came from the source, fully or in part.
  std::array<std::uint64_t, kMaxSources> used_sweeps{};
  std::array<double, kMaxSources> largest_test_ratios{};               ///< by source; zero without a comparison
  std::array<std::optional<OdometryFindings>, kMaxSources> compared{}; ///< by source; nothing for an IMU
  std::uint64_t dead_reckoned = 0;                                     ///< sweeps in this state
  std::uint64_t without_source = 0; ///< sweeps after the first whose prior no source measured, not even in part
  StageTimes stages{};
  double path_m = 0;
  double largest_speed_mps = 0; ///< maximum over all estimates
  std::optional<OdometryEstimate> last;
  Duration last_at{}; ///< arrival of `last`, CLOCK_MONOTONIC
  LatencyHistogram process;
  Percentiles process_ms, process_cpu_ms;
  double rate_hz = 0; ///< over the last five seconds; zero when estimates have stopped
  /// First 16 digits of the SHA-256 of all poses, with their times since the first one. Differs between instruction
  /// sets, as the bits of the poses do.
  std::string trajectory_digest;
};

/// Accumulates SweepFigures over the sweeps. One owner.
class SweepStatistics {
 public:
  /// Computes distributions over the last `window` sweeps, at 16 bytes each.
  explicit SweepStatistics(std::size_t window) : window_(window) {}

  void add(const ProcessedSweep& sweep);
  [[nodiscard]] SweepFigures figures() const;

 private:
  struct Timing {
    Duration at; ///< CLOCK_MONOTONIC
    float wall_ms, cpu_ms;
  };
  [[nodiscard]] Percentiles percentiles(float Timing::*figure) const;
  [[nodiscard]] double rate_hz() const;
  void add_to_trajectory(const OdometryEstimate& estimate);

  std::size_t window_;
  SweepFigures sums_; ///< distributions, rate, digest and comparisons are unset
  std::array<std::optional<OdometryComparison>, kMaxSources> comparisons_;
  std::vector<Timing> timings_; ///< ring buffer once it holds `window_` entries
  Stamp trajectory_start_;
  Sha256 trajectory_;
};

/// State and counters of the link to the robot's network.
struct LinkFigures {
  bool connected = false;
  std::uint64_t attempts = 0; ///< attempts to connect, including the successful one
  std::string problem;        ///< reason of the last failure
  struct Source {
    std::uint32_t writers = 0;        ///< current publishers of its topic
    std::uint64_t received = 0;       ///< samples, including rejected ones
    std::uint64_t refused = 0;        ///< samples of a second writer or above the rate limit, see Admission
    std::uint64_t health_refused = 0; ///< the same for its health topic
  };
  std::vector<Source> sources;           ///< by index in the configuration
  std::vector<Source> lidars;            ///< the same for lidars; set for those that publish clouds
  std::uint64_t flat_ground_refused = 0; ///< rejected messages on the flat-ground topic
};

/// All figures of a run or of a running service. Source of every user-visible form: summary.json, the status as JSON
/// and as text, metrics; /diagnostics uses the values of the JSON.
struct Figures {
  const Config& config;
  std::string capture{}; ///< capture as named by the user, or the recording folder of a service; empty: none
  Duration duration{};   ///< length of the recording, or time since the start of the service
  MachineTime spent{};
  IngestReport ingest{};
  SweepCounters counters{};
  SweepFigures sweeps{};

  /// Figures that exist in a service only.
  struct Live {
    FlatGround flat_ground = FlatGround::off;
    std::uint64_t kernel_drops = 0, filtered = 0, motion_drops = 0; ///< see LiveInput
    std::array<std::uint64_t, kMaxLidars> cloud_drops{};            ///< see LiveInput; by lidar
    std::uint64_t unfetched = 0;                                    ///< see LivePipeline
    std::uint64_t unpublished = 0;                                  ///< estimates not accepted by DDS
    /// How often the odometry started at the origin or at a given pose since the start of the process, rather than
    /// where it was before; counted with its first estimate.
    std::uint64_t resets = 0;
    LinkFigures link;
    std::optional<Recorder::Status> recording;
    std::optional<Incidents::Status> incidents; ///< empty if incidents are not stored
  };
  std::optional<Live> live{};
};

/// Returns the time since `then` by the host's wall clock; empty for never (Stamp{}).
std::optional<Duration> time_since(Stamp then);

/// Returns "healthy", "lost" or "never heard".
std::string_view health_of(const IngestReport::Source& source);

/// Describes an IMU that is too slow to measure the motion within a sweep, following its name; empty otherwise.
std::optional<std::string> slow_imu(const IngestReport::Source& source);

/// Says what is wrong with a source as a whole, or why its samples are refused for longer than is worth telling: at
/// present in a service, at its longest in a finished replay. Follows the name of the source; empty if all is well.
std::string verdict_on(const IngestReport::Source& source, bool is_live);

/// Describes a current fault found in a lidar's packets or clouds; empty if there is none.
std::string problem_of(const LidarOptions& options, const IngestReport::Lidar& lidar);

/// Rounds to four decimals, the precision of all figures here.
double rounded(double value);

/// Returns the contents of summary.json except those that need ground truth; also the answer to locusctl status --json.
nlohmann::ordered_json to_json(const Figures& figures);

/// Summarises a run in one line: the last one of locus-replay, and of the log of a service for each run.
std::string summary_line(const Figures& figures);

/// Formats the status of a service as text, 80 x 24 with three lidars and four motion sources. Precondition: live.
std::string to_text(const Figures& figures);

/// Formats the figures for Prometheus, as OpenMetrics 1.0 text. Precondition: live.
std::string to_open_metrics(const Figures& figures);

/// Returns the peak resident memory of this process, in megabytes.
double peak_rss_mb();

} // namespace locus::daemon
