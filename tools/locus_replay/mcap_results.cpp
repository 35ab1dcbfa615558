// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/mcap_results.hpp"

#include "daemon/dds/diagnostics.hpp"
#include "daemon/dds/sweep_points.hpp"

namespace locus::tools {
namespace {

namespace ros = daemon::ros;

constexpr std::size_t kTalliedSweeps = 100; ///< window of the distributions in the diagnostics

} // namespace

McapResults::McapResults(const std::filesystem::path& file, const Config& config)
    : config_(config), frames_{config.dds.frame_odom, config.dds.frame_base}, messages_(file),
      inputs_(messages_, config), odometry_(messages_.add_topic<ros::Odometry>(config.dds.prefix + "/odometry")),
      tf_(messages_.add_topic<ros::TFMessage>("/tf")),
      cloud_(messages_.add_topic<ros::PointCloud2>(config.dds.prefix + "/cloud")),
      diagnostics_(messages_.add_topic<ros::DiagnosticArray>("/diagnostics")), tally_(kTalliedSweeps) {}

void McapResults::add(const Sweep& sweep, const Odometry& odometry, const daemon::ProcessedSweep& done) {
  const OdometryEstimate& estimate = done.estimate;
  now_ = estimate.stamp;
  tally_.add(done);
  messages_.write(odometry_, now_, daemon::to_ros(daemon::report_of(estimate), frames_));
  ros::TransformStamped transform = daemon::to_ros_transform(estimate.stamp, estimate.T_odom_base, frames_);
  messages_.write(tf_, now_, ros::TFMessage{{1, 1, &transform, false}});
  daemon::sweep_points(sweep.points, odometry.scan(), points_);
  messages_.write(cloud_, now_, cloud_message_.make(points_, estimate.stamp, frames_.base));
}

void McapResults::add(const daemon::Ingest& ingest, const daemon::SweepCounters& counters) {
  constexpr Duration kPeriod = std::chrono::seconds{1};
  if (std::chrono::abs(now_ - diagnosed_) < kPeriod)
    return;
  diagnosed_ = now_;
  daemon::Figures figures{.config = config_, .counters = counters, .sweeps = tally_.figures()};
  figures.ingest.read(ingest);
  messages_.write(diagnostics_, now_, daemon::DiagnosticsMessage(daemon::diagnostics(figures, now_), now_).message());
}

} // namespace locus::tools
