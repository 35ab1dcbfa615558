// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/mcap_results.hpp"

#include <fmt/format.h>

#include "bags/ros_definitions.hpp"
#include "daemon/dds/cdr.hpp"
#include "daemon/dds/diagnostics.hpp"
#include "daemon/dds/sweep_points.hpp"

namespace locus::tools {
namespace {

namespace ros = daemon::ros;

constexpr std::size_t kTalliedSweeps = 100; ///< window of the distributions in the diagnostics

} // namespace

McapResults::McapResults(const std::filesystem::path& file, const Config& config)
    : config_(config), frames_{config.dds.frame_odom, config.dds.frame_base}, writer_(file),
      odometry_(add<ros::Odometry>(config.dds.prefix + "/odometry")), tf_(add<ros::TFMessage>("/tf")),
      cloud_(add<ros::PointCloud2>(config.dds.prefix + "/cloud")),
      diagnostics_(add<ros::DiagnosticArray>("/diagnostics")), tally_(kTalliedSweeps) {}

template <class Message> std::uint16_t McapResults::add(const std::string& topic) {
  const ros::Type type = ros::type_of<Message>();
  const std::string name = ros::name_in_ros2(*type.descriptor);
  return writer_.add({topic, name, ros2_definition(name), fmt::format("RIHS01_{}", type.hash)});
}

template <class Message> void McapResults::write(std::uint16_t channel, const Message& message) {
  ros::serialise(message, serialised_);
  writer_.write(channel, now_, serialised_);
}

void McapResults::take(const Sweep& sweep, const Odometry& odometry, const daemon::ProcessedSweep& done) {
  const OdometryEstimate& estimate = done.estimate;
  now_ = estimate.stamp;
  tally_.add(done);
  write(odometry_, daemon::to_ros(daemon::report_of(estimate), frames_));
  ros::TransformStamped transform = daemon::to_ros_transform(estimate.stamp, estimate.T_odom_base, frames_);
  write(tf_, ros::TFMessage{{1, 1, &transform, false}});
  daemon::sweep_points(sweep.points, odometry.scan(), points_);
  write(cloud_, cloud_message_.make(points_, estimate.stamp, frames_.base));
}

void McapResults::take(const daemon::Ingest& ingest, const daemon::SweepCounters& counters) {
  constexpr Duration kPeriod = std::chrono::seconds{1};
  if (std::chrono::abs(now_ - diagnosed_) < kPeriod)
    return;
  diagnosed_ = now_;
  daemon::Figures figures{.config = config_, .counters = counters, .sweeps = tally_.figures()};
  figures.ingest.read(ingest);
  write(diagnostics_, daemon::DiagnosticsMessage(daemon::diagnostics(figures, now_), now_).message());
}

} // namespace locus::tools
