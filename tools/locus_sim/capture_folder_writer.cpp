// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/capture_folder_writer.hpp"

#include <fmt/ostream.h>

#include <algorithm>
#include <cerrno>
#include <fstream>
#include <iterator>
#include <numbers>
#include <stdexcept>
#include <system_error>

#include "locus_sim/pcap_writer.hpp"

namespace locus::sim {
namespace {

constexpr double kImuRate_hz = 200, kTruthRate_hz = 100;
constexpr std::uint32_t kBroadcast = 0xFFFF'FFFF;

/// A text file that was written in full when close() returns.
class TextFile {
 public:
  explicit TextFile(const std::filesystem::path& path) : path_(path), stream_(path) {}

  template <class... Values> void print(fmt::format_string<Values...> format, Values&&... values) {
    fmt::print(stream_, format, std::forward<Values>(values)...);
  }
  void close() {
    stream_.close();
    if (!stream_)
      throw std::runtime_error(path_.string() + ": " + std::generic_category().message(errno));
  }

 private:
  std::filesystem::path path_;
  std::ofstream stream_;
};

/// One line of a TUM file; integer arithmetic keeps the stamp to the nanosecond.
void print_tum(TextFile& file, Stamp stamp, const Pose& pose) {
  const std::int64_t ns = to_ns(stamp);
  const Eigen::Vector3d& p = pose.translation;
  const Eigen::Quaterniond& q = pose.rotation;
  file.print("{}.{:09} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f}\n", ns / 1'000'000'000, ns % 1'000'000'000,
             p.x(), p.y(), p.z(), q.x(), q.y(), q.z(), q.w());
}

/// All lidars into one file, in the order in which their packets arrive.
void write_lidars(const std::filesystem::path& path, const Scene& scene, const Trajectory& trajectory, Stamp end,
                  const std::vector<NamedLidar>& lidars, SeenSpace* seen, const std::function<void(double)>& progress) {
  std::vector<SyntheticLidar> sources;
  std::vector<Datagram> next;
  for (const NamedLidar& lidar : lidars)
    sources.emplace_back(scene, trajectory, lidar.options, seen);
  std::transform(sources.begin(), sources.end(), std::back_inserter(next), [](auto& source) { return source.next(); });

  PcapWriter pcap(path);
  while (true) {
    const auto earliest = std::min_element(next.begin(), next.end(), [](const Datagram& a, const Datagram& b) {
      return a.receive_stamp < b.receive_stamp;
    });
    if (earliest == next.end() || earliest->receive_stamp > end)
      return;
    progress(to_seconds(earliest->receive_stamp - trajectory.start()) / to_seconds(end - trajectory.start()));
    pcap.write(earliest->receive_stamp, earliest->source_ip, earliest->source_port, kBroadcast,
               earliest->destination_port, earliest->payload);
    *earliest = sources[static_cast<std::size_t>(earliest - next.begin())].next();
  }
}

void write_imu(const std::filesystem::path& path, SyntheticImu imu, Stamp end) {
  TextFile file(path);
  file.print("#t_ns,wx,wy,wz,ax,ay,az,qw,qx,qy,qz\n");
  for (ImuSample sample = imu.next(); sample.stamp <= end; sample = imu.next()) {
    const Eigen::Vector3d &w = sample.angular_velocity_radps, &a = sample.specific_force_mps2;
    const Eigen::Quaterniond& q = *sample.attitude;
    file.print("{},{:.9f},{:.9f},{:.9f},{:.9f},{:.9f},{:.9f},{:.9f},{:.9f},{:.9f},{:.9f}\n", to_ns(sample.stamp), w.x(),
               w.y(), w.z(), a.x(), a.y(), a.z(), q.w(), q.x(), q.y(), q.z());
  }
  file.close();
}

void write_odometry(const std::filesystem::path& path, SyntheticOdometry odometry, Stamp end) {
  TextFile file(path);
  for (OdometrySample sample = odometry.next(); sample.stamp <= end; sample = odometry.next())
    print_tum(file, sample.stamp, sample.T_source_base);
  file.close();
}

void write_truth(const std::filesystem::path& path, const Trajectory& trajectory, Stamp end) {
  TextFile file(path);
  for (Stamp stamp = trajectory.start(); stamp <= end; stamp += from_seconds(1 / kTruthRate_hz))
    print_tum(file, stamp, trajectory.T_world_base(stamp));
  file.close();
}

std::string dotted(std::uint32_t ip) {
  return fmt::format("{}.{}.{}.{}", ip >> 24, ip >> 16 & 0xFFu, ip >> 8 & 0xFFu, ip & 0xFFu);
}

std::string yaml(const Pose& pose) {
  const Eigen::Vector3d& xyz_m = pose.translation;
  const Eigen::Vector3d rpy_deg = to_rpy_rad(pose.rotation) * (180 / std::numbers::pi);
  return fmt::format("{{xyz_m: [{:.6f}, {:.6f}, {:.6f}], rpy_deg: [{:.6f}, {:.6f}, {:.6f}]}}", xyz_m.x(), xyz_m.y(),
                     xyz_m.z(), rpy_deg.x(), rpy_deg.y(), rpy_deg.z());
}

void write_config(const std::filesystem::path& path, const RobotOptions& robot) {
  TextFile file(path);
  file.print("lidars:\n");
  for (const auto& [name, options] : robot.lidars)
    file.print("  - {{name: {}, model: {}, port: {}, source_ip: {}, T_base_lidar: {}}}\n", name,
               to_string(options.model), options.port, dotted(options.source_ip), yaml(options.T_base_lidar));
  file.print("motion_sources:{}\n", robot.odometry.empty() && !robot.imu ? " []" : "");
  for (const NamedOdometry& odometry : robot.odometry)
    file.print("  - {{name: {}, kind: odometry, topic: {}}}\n", odometry.name, odometry.topic);
  if (robot.imu)
    file.print("  - {{name: imu, kind: imu, topic: /imu/data, T_base_source: {}}}\n", yaml(robot.imu->T_base_imu));
  file.close();
}

} // namespace

void write_capture_folder(const std::filesystem::path& folder, const Scene& scene, const Trajectory& trajectory,
                          Duration duration, const RobotOptions& robot, SeenSpace* seen,
                          const std::function<void(double)>& progress) {
  std::filesystem::create_directories(folder);
  const Stamp end = trajectory.start() + duration;
  write_config(folder / "config.yaml", robot);
  write_truth(folder / "gt.tum", trajectory, end);
  std::uint64_t seed = robot.seed;
  if (robot.imu)
    write_imu(folder / "imu.csv", SyntheticImu(trajectory, kImuRate_hz, robot.imu->faults, seed, robot.imu->T_base_imu),
              end);
  for (const NamedOdometry& odometry : robot.odometry)
    write_odometry(folder / (odometry.name + ".tum"),
                   SyntheticOdometry(trajectory, odometry.rate_hz, odometry.faults, ++seed), end);
  write_lidars(folder / "lidar.pcap", scene, trajectory, end, robot.lidars, seen, progress);
}

} // namespace locus::sim
