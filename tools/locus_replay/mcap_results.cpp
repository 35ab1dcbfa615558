// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/mcap_results.hpp"

#include <utility>
#include <variant>

#include <fmt/format.h>

#include "bags/ros_definitions.hpp"
#include "daemon/dds/cdr.hpp"
#include "daemon/dds/diagnostics.hpp"
#include "daemon/dds/sweep_points.hpp"
#include "locus_replay/motion_messages.hpp"

namespace locus::tools {
namespace {

namespace ros = daemon::ros;

constexpr std::size_t kTalliedSweeps = 100; ///< window of the distributions in the diagnostics

} // namespace

McapResults::McapResults(const std::filesystem::path& file, const Config& config)
    : config_(config), frames_{config.dds.frame_odom, config.dds.frame_base}, writer_(file),
      odometry_(add_topic<ros::Odometry>(config.dds.prefix + "/odometry")), tf_(add_topic<ros::TFMessage>("/tf")),
      static_tf_(add_topic<ros::TFMessage>("/tf_static")),
      cloud_(add_topic<ros::PointCloud2>(config.dds.prefix + "/cloud")),
      diagnostics_(add_topic<ros::DiagnosticArray>("/diagnostics")), tally_(kTalliedSweeps) {
  for (const MotionSource& source : config.motion_sources) {
    const std::string topic = source.topic.empty() ? "/" + source.name : source.topic;
    sources_.push_back(source.kind == SourceKind::imu ? add_topic<ros::Imu>(topic) : add_topic<ros::Odometry>(topic));
  }
}

template <class Message> std::uint16_t McapResults::add_topic(const std::string& topic) {
  const ros::Type type = ros::type_of<Message>();
  const std::string name = ros::name_in_ros2(*type.descriptor);
  return writer_.add({topic, name, ros2_definition(name), fmt::format("RIHS01_{}", type.hash)});
}

template <class Message> void McapResults::write(std::uint16_t channel, Stamp stamp, const Message& message) {
  ros::serialise(message, serialised_);
  writer_.write(channel, stamp, serialised_);
}

/// Writes where the IMUs sit on the base.
void McapResults::write_mountings(Stamp stamp) {
  std::vector<daemon::FrameNames> frames;
  for (const MotionSource& source : config_.motion_sources)
    frames.push_back({frames_.base, source.name});
  std::vector<ros::TransformStamped> transforms;
  for (std::size_t i = 0; i < frames.size(); ++i)
    if (config_.motion_sources[i].kind == SourceKind::imu)
      transforms.push_back(daemon::to_ros_transform(stamp, config_.motion_sources[i].T_base_source, frames[i]));
  const auto count = static_cast<std::uint32_t>(transforms.size());
  write(static_tf_, stamp, ros::TFMessage{{count, count, transforms.data(), false}});
}

void McapResults::add(const daemon::Input& input) {
  const auto* const imu = std::get_if<daemon::ImuInput>(&input);
  const auto* const odometry = std::get_if<daemon::OdometryInput>(&input);
  if (imu == nullptr && odometry == nullptr)
    return;
  const Stamp arrival = imu != nullptr ? imu->sample.arrival : odometry->sample.arrival;
  if (!std::exchange(has_mountings_, true))
    write_mountings(arrival);
  const std::size_t source = index_of(imu != nullptr ? imu->source : odometry->source);
  if (imu != nullptr)
    write(sources_[source], arrival, to_ros(imu->sample, config_.motion_sources[source].name));
  else
    write(sources_[source], arrival, to_ros(odometry->sample, frames_));
}

void McapResults::add(const Sweep& sweep, const Odometry& odometry, const daemon::ProcessedSweep& done) {
  const OdometryEstimate& estimate = done.estimate;
  now_ = estimate.stamp;
  tally_.add(done);
  write(odometry_, now_, daemon::to_ros(daemon::report_of(estimate), frames_));
  ros::TransformStamped transform = daemon::to_ros_transform(estimate.stamp, estimate.T_odom_base, frames_);
  write(tf_, now_, ros::TFMessage{{1, 1, &transform, false}});
  daemon::sweep_points(sweep.points, odometry.scan(), points_);
  write(cloud_, now_, cloud_message_.make(points_, estimate.stamp, frames_.base));
}

void McapResults::add(const daemon::Ingest& ingest, const daemon::SweepCounters& counters) {
  constexpr Duration kPeriod = std::chrono::seconds{1};
  if (std::chrono::abs(now_ - diagnosed_) < kPeriod)
    return;
  diagnosed_ = now_;
  daemon::Figures figures{.config = config_, .counters = counters, .sweeps = tally_.figures()};
  figures.ingest.read(ingest);
  write(diagnostics_, now_, daemon::DiagnosticsMessage(daemon::diagnostics(figures, now_), now_).message());
}

} // namespace locus::tools
