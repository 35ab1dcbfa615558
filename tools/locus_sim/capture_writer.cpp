// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/capture_writer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>
#include <variant>

#include "drivers/files/capture_folder.hpp"
#include "drivers/files/motion_files.hpp"
#include "drivers/net/datagram.hpp"
#include "locus_sim/folder_sink.hpp"
#include "locus_sim/ouster_imu.hpp"
#include "locus_sim/ouster_sensor.hpp"

namespace locus::sim {
namespace {

constexpr double kImuRate_hz = 200, kTruthRate_hz = 100;
constexpr int kDecimals = 9;

struct Line {
  Stamp arrival;
  std::string text;
};

/// Generates a file line by line, one line ahead of the writing.
class LineSource {
 public:
  LineSource(std::string file, std::function<Line()> make)
      : file_(std::move(file)), make_(std::move(make)), next_(make_()) {}

  [[nodiscard]] Stamp arrival() const { return next_.arrival; }
  void write(CaptureSink& sink) {
    sink.text(file_, next_.arrival, next_.text);
    next_ = make_();
  }

 private:
  std::string file_;
  std::function<Line()> make_;
  Line next_;
};

std::vector<LineSource> line_sources(const Trajectory& trajectory, const RobotOptions& robot) {
  std::vector<LineSource> sources;
  std::uint64_t seed = robot.seed;
  if (robot.imu)
    sources.emplace_back("imu.csv", [imu = SyntheticImu(trajectory, kImuRate_hz, robot.imu->faults, seed,
                                                        robot.imu->T_base_imu)]() mutable {
      const ImuSample sample = imu.next();
      return Line{sample.arrival, to_line(sample, kDecimals)};
    });
  for (const NamedOdometry& odometry : robot.odometry)
    sources.emplace_back(odometry.name + ".tum",
                         [source = SyntheticOdometry(trajectory, odometry.rate_hz, odometry.faults, ++seed)]() mutable {
                           const OdometrySample sample = source.next();
                           return Line{sample.arrival, to_line({sample.stamp, sample.T_source_base}, kDecimals)};
                         });
  sources.emplace_back("gt.tum", [&trajectory, next = trajectory.start()]() mutable {
    const Stamp stamp = std::exchange(next, next + from_seconds(1 / kTruthRate_hz));
    return Line{stamp, to_line({stamp, trajectory.T_world_base(stamp)}, kDecimals)};
  });
  return sources;
}

/// Merges the datagrams of all lidars and their inertial units, in order of arrival. One owner.
class Lidars {
 public:
  Lidars(const Scene& scene, const Trajectory& trajectory, const std::vector<NamedLidar>& lidars,
         ObservedSpace* observed) {
    for (const NamedLidar& lidar : lidars) {
      senders_.emplace_back(SyntheticLidar(scene, trajectory, lidar.options, observed));
      if (lidar.imu)
        senders_.emplace_back(OusterImu(trajectory, lidar.options, *lidar.imu));
    }
    for (Sender& sender : senders_)
      waiting_.push_back(next_of(sender));
  }

  /// Returns the next datagram; there is always one.
  [[nodiscard]] const Datagram& front() const { return waiting_[earliest()]; }
  void pop() {
    const std::size_t index = earliest();
    waiting_[index] = next_of(senders_[index]);
  }

 private:
  [[nodiscard]] std::size_t earliest() const {
    const auto found = std::min_element(waiting_.begin(), waiting_.end(), [](const Datagram& a, const Datagram& b) {
      return a.receive_stamp < b.receive_stamp;
    });
    return static_cast<std::size_t>(found - waiting_.begin());
  }

  using Sender = std::variant<SyntheticLidar, OusterImu>;
  static Datagram next_of(Sender& sender) {
    return std::visit([](auto& its) { return its.next(); }, sender);
  }

  std::vector<Sender> senders_;
  std::vector<Datagram> waiting_;
};

std::string yaml(const Eigen::Vector3d& vector) {
  return fmt::format("[{:.6f}, {:.6f}, {:.6f}]", vector.x(), vector.y(), vector.z());
}

std::string yaml(const Pose& pose) {
  const Eigen::Vector3d rpy_deg = to_rpy_rad(pose.rotation) / kRadPerDeg + Eigen::Vector3d::Zero();
  return fmt::format("{{xyz_m: {}, rpy_deg: {}}}", yaml(pose.translation), yaml(rpy_deg));
}

/// Returns the model, with the path of the metadata for an Ouster.
std::string model_of(const NamedLidar& lidar) {
  if (is_ouster(lidar.options.model))
    return "Ouster, metadata: " + metadata_file(lidar.name);
  const auto* const hesai = std::get_if<hesai::Model>(&lidar.options.model);
  return std::string(hesai != nullptr ? to_string(*hesai)
                                      : velodyne::to_string(std::get<velodyne::Model>(lidar.options.model)));
}

std::string configuration(const RobotOptions& robot) {
  std::string text = "lidars:\n";
  for (const NamedLidar& lidar : robot.lidars) {
    const auto& options = lidar.options;
    const bool shares_port = std::count_if(robot.lidars.begin(), robot.lidars.end(), [&](const NamedLidar& other) {
                               return other.options.port == options.port;
                             }) > 1;
    text += fmt::format("  - {{name: {}, model: {}, port: {}{}, T_base_lidar: {}}}\n", lidar.name, model_of(lidar),
                        options.port, shares_port ? ", source_ip: " + dotted(options.source_ip) : "",
                        yaml(lidar.T_base_configured.value_or(options.T_base_lidar)));
  }
  text += fmt::format("motion_sources:{}\n", robot.odometry.empty() && !robot.imu ? " []" : "");
  for (const NamedOdometry& odometry : robot.odometry)
    text += fmt::format("  - {{name: {}, kind: odometry, topic: {}}}\n", odometry.name, odometry.topic);
  if (robot.imu)
    text += fmt::format("  - {{name: imu, kind: imu, topic: /imu/data, T_base_source: {}}}\n",
                        yaml(robot.imu->T_base_configured.value_or(robot.imu->T_base_imu)));
  if (robot.max_speed_mps)
    text += fmt::format("motion: {{max_speed_mps: {}}}\n", *robot.max_speed_mps);
  if (robot.body_box)
    text += fmt::format("body_box: {{enabled: true, min_m: {}, max_m: {}}}\n", yaml(robot.body_box->min_m),
                        yaml(robot.body_box->max_m));
  return text;
}

} // namespace

void write_capture(CaptureSink& sink, const Scene& scene, const Trajectory& trajectory, Duration duration,
                   const RobotOptions& robot, ObservedSpace* observed, const std::function<void(double)>& progress) {
  const Stamp start = trajectory.start(), end = start + duration;
  sink.text("config.yaml", start, configuration(robot));
  for (const NamedLidar& lidar : robot.lidars)
    if (is_ouster(lidar.options.model))
      sink.text(metadata_file(lidar.name), start, OusterSensor(lidar.options, start).metadata_text());
  if (robot.imu)
    sink.text("imu.csv", start, "#t_ns,wx,wy,wz,ax,ay,az,qw,qx,qy,qz\n");
  std::vector<LineSource> texts = line_sources(trajectory, robot);
  const auto write_texts_until = [&](Stamp stamp) {
    while (true) {
      const auto next = std::min_element(texts.begin(), texts.end(), [](const LineSource& a, const LineSource& b) {
        return a.arrival() < b.arrival();
      });
      if (next->arrival() > stamp)
        return;
      next->write(sink);
    }
  };
  for (Lidars lidars(scene, trajectory, robot.lidars, observed); lidars.front().receive_stamp <= end; lidars.pop()) {
    write_texts_until(lidars.front().receive_stamp);
    sink.datagram(lidars.front());
    progress(to_seconds(lidars.front().receive_stamp - start) / to_seconds(duration));
  }
  write_texts_until(end);
  sink.close();
}

void write_capture_folder(const std::filesystem::path& folder, const Scene& scene, const Trajectory& trajectory,
                          Duration duration, const RobotOptions& robot) {
  FolderSink sink(folder);
  write_capture(sink, scene, trajectory, duration, robot);
}

} // namespace locus::sim
