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
#include "core/ingest/sweep.hpp"
#include "daemon/incidents.hpp"
#include "daemon/ingest.hpp"
#include "daemon/recorder.hpp"
#include "daemon/sweep_processor.hpp"

namespace locus::daemon {

/// What the ingest has counted so far, as a copy that other threads may read. Plain memory.
struct IngestReport {
  /// Of a lidar that gives clouds: as CloudDecoder has them.
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
    std::optional<Clouds> clouds{};      ///< of one that gives these
    std::string_view model, return_mode; ///< as LidarInput has them; empty before the first good packet
    double rotation_rate_rpm = 0.0;
    std::optional<std::uint32_t> source_ip;        ///< host byte order
    std::optional<std::uint32_t> refused_ip;       ///< LidarInput::refused_ip()
    LidarInput::Strangers strangers;               ///< LidarInput::strangers()
    std::optional<UnknownPackets> unknown_packets; ///< LidarInput::unknown_packets()
    Stamp last_heard;                              ///< LidarInput::last_heard()
    Stamp unknown_last_heard;                      ///< LidarInput::unknown_last_heard()
    std::string_view pps = "absent";               ///< LidarInput::clock_state()
    bool tells_date = false;                       ///< LidarInput::tells_date()
    std::uint64_t packets_of_other_mode = 0; ///< ouster::Decoder::packets_of_other_start() where is_in_other_mode()

    static Lidar of(const LidarInput& lidar);
    void add(const CloudDecoder& decoder);

    /// Data packets or clouds.
    [[nodiscard]] std::uint64_t used() const { return clouds ? clouds->counters.used : packets.data; }
    [[nodiscard]] std::uint64_t received() const { return clouds ? clouds->counters.received : packets.received; }
  };
  struct Source {
    SourceCounters counters;
    bool healthy = false;
    Stamp last_heard;         ///< HealthMonitor::last_heard()
    std::string_view verdict; ///< text that lives for ever; see HealthMonitor
  };

  PacketCounters total;
  std::array<Lidar, kMaxLidars> lidars;    ///< by index
  std::array<Source, kMaxSources> sources; ///< by index
  SweepBuilder::Counters sweeps;

  /// Called by the ingest thread.
  void read(const Ingest& ingest);
  /// Whether any lidar has brought anything of use.
  [[nodiscard]] bool has_lidar_data() const {
    return std::ranges::any_of(lidars, [](const Lidar& lidar) { return lidar.used() > 0; });
  }
};

/// That somebody else, who may be a second lidar, sends to the port of a lidar whose address is not configured: who,
/// and the configuration that tells them apart. Nothing while next to nothing is refused for it.
std::optional<std::string> shared_port(const LidarOptions& options, const IngestReport::Lidar& lidar);

/// That packets of a model which cannot be read come to a lidar's port, and what they say of themselves. Nothing while
/// there are next to none.
std::optional<std::string> unknown_model(const LidarOptions& options, const IngestReport::Lidar& lidar);

/// What is wrong with the times in a lidar's clouds, a line each.
std::vector<std::string> cloud_doubts(const LidarOptions& options, const IngestReport::Lidar& lidar);

/// That an Ouster was started anew since its metadata was fetched, and for turns now does not turn as that says, so
/// that its packets are refused; nothing where they are not.
std::optional<std::string> stale_metadata(const LidarOptions& options, const IngestReport::Lidar& lidar);

/// What the owner of a lidar should know of sweeps that are shorter than its turn; nothing where they are not.
std::optional<std::string> short_sweep(const SweepOptions& options, const std::string& lidar, double rotation_rate_rpm);

/// That estimates are faster than the robot is said to be able to; nothing while they are not.
std::optional<std::string> too_fast(const MotionLimits& limits, double largest_speed_mps);

/// Of a pose, a twist or an observability, by index.
inline constexpr std::array<std::string_view, 6> kAxes{"x", "y", "z", "roll", "pitch", "yaw"};

/// Of a distribution.
struct Percentiles {
  double p50 = 0, p90 = 0, p99 = 0, max = 0;
};

/// How long the sweeps took, each of them counted for good.
struct LatencyHistogram {
  /// Upper bounds. They are chosen for deadlines of one revolution, 50 to 200 ms, and what a sweep takes, from 1 ms.
  static constexpr std::array<double, 9> kBounds_s{0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5};

  std::array<std::uint64_t, kBounds_s.size() + 1> counts{}; ///< by the bound; the last is of those beyond all
  double sum_s = 0;

  void take(double took_s);
};

/// What is told of the sweeps that were processed: sums since the start, and distributions of the last ones.
struct SweepFigures {
  std::uint64_t sweeps = 0;
  double raw_points = 0, filtered_points = 0, scan_to_scan_iterations = 0, scan_to_submap_iterations = 0;
  /// Those whose prior came from the source, all of it or in part.
  std::array<std::uint64_t, kMaxSources> used_sweeps{};
  StageTimes stages{};
  double path_m = 0;
  double largest_speed_mps = 0; ///< that any estimate claims
  std::optional<OdometryEstimate> last;
  Duration last_at{}; ///< CLOCK_MONOTONIC when it was taken
  LatencyHistogram process;
  Percentiles process_ms, process_cpu_ms;
  double rate_hz = 0; ///< over the last few seconds: zero once no more come
};

/// Adds up SweepFigures from sweep to sweep. One owner.
class SweepTally {
 public:
  /// Distributions are those of the last `window` sweeps, of which each takes 16 bytes.
  explicit SweepTally(std::size_t window) : window_(window) {}

  void take(const ProcessedSweep& sweep);
  [[nodiscard]] SweepFigures figures() const;

 private:
  struct Timing {
    Duration at; ///< CLOCK_MONOTONIC
    float wall_ms, cpu_ms;
  };
  [[nodiscard]] Percentiles percentiles(float Timing::*figure) const;
  [[nodiscard]] double rate_hz() const;

  std::size_t window_;
  SweepFigures sums_;           ///< without distributions and rate
  std::vector<Timing> timings_; ///< as a ring, once there are `window_`
};

/// What is told of the link to the robot's network.
struct LinkFigures {
  bool connected = false;
  std::uint64_t attempts = 0; ///< so far, the one that succeeded included
  std::string problem;        ///< why the last one failed
  struct Source {
    std::uint32_t writers = 0;        ///< that send its topic now
    std::uint64_t received = 0;       ///< samples, those refused included
    std::uint64_t refused = 0;        ///< of other writers than the first, or more than any sensor sends
    std::uint64_t health_refused = 0; ///< of its health topic, the same
  };
  std::vector<Source> sources;           ///< by the index of the configuration
  std::vector<Source> lidars;            ///< the same, of those that give clouds
  std::uint64_t flat_ground_refused = 0; ///< of its topic, the same
};

/// All figures of a run or of a running service. What users see of them is made here: summary.json, the status as JSON
/// and as text, metrics; /diagnostics takes its values from the JSON.
struct Figures {
  const Config& config;
  std::string capture{}; ///< as the user named it, or the folder that a service records to; empty: none
  Duration duration{};   ///< of the recording, or since the service began
  MachineTime spent{};
  IngestReport ingest{};
  SweepCounters counters{};
  SweepFigures sweeps{};

  /// What only a service has.
  struct Live {
    FlatGround flat_ground = FlatGround::off;
    std::uint64_t kernel_drops = 0, filtered = 0, motion_drops = 0; ///< see LiveInput
    std::array<std::uint64_t, kMaxLidars> cloud_drops{};            ///< see LiveInput; by lidar
    std::uint64_t unfetched = 0;                                    ///< see LivePipeline
    std::uint64_t unpublished = 0;                                  ///< estimates that DDS did not take
    LinkFigures link;
    std::optional<Recorder::Status> recording;
    std::optional<Incidents::Status> incidents; ///< where any are kept
  };
  std::optional<Live> live{};
};

/// Since then, by the clock of the host; nothing for never.
std::optional<Duration> time_since(Stamp then);

/// "healthy", "lost" or "never heard".
std::string_view health_of(const IngestReport::Source& source);

/// What its packets tell is wrong with a lidar, though it may be heard; empty if nothing is.
std::string problem_of(const LidarOptions& options, const IngestReport::Lidar& lidar);

/// Four digits behind the point: no figure here is known better.
double rounded(double value);

/// The contents of summary.json, as far as no truth is needed; of a service the answer to locusctl status --json.
nlohmann::ordered_json to_json(const Figures& figures);

/// The status of a service for human eyes: fits 80 x 24 with three lidars and four motion sources. Precondition: live.
std::string to_text(const Figures& figures);

/// The same figures for Prometheus, as text of OpenMetrics 1.0. Precondition: live.
std::string to_open_metrics(const Figures& figures);

/// Of this process since it began, in megabytes.
double peak_rss_mb();

} // namespace locus::daemon
