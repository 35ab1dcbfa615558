// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <iterator>
#include <utility>

#include <arpa/inet.h>
#include <fmt/format.h>

#include "drivers/clouds/cloud_layout.hpp"
#include "drivers/files/motion_rows.hpp"
#include "liblocus/cloud_records.hpp"
#include "liblocus/engine.hpp"
#include "liblocus/liblocus.hpp"
#include "locus_replay/failure.hpp"
#include "locus_replay/replay_config.hpp"

namespace liblocus {

using namespace locus; // the implementation

Error::~Error() = default;

std::string_view name_of(State state) { return to_string(TrackingState{static_cast<std::uint8_t>(state)}); }

std::uint32_t parse_ip(std::string_view text) {
  in_addr address{};
  if (inet_pton(AF_INET, std::string(text).c_str(), &address) != 1)
    throw Error(fmt::format("source_ip: \"{}\" is not an IPv4 address; write it as 192.168.1.201", text));
  return ntohl(address.s_addr);
}

struct Odometry::Implementation {
  library::Engine engine;
  library::CloudRecords cloud;
  bool finished = false;

  explicit Implementation(const Config& config)
      : engine(config, tools::value_or_fail(LidarRouter::open(config.lidars), tools::ExitStatus::wrong_usage)) {}

  /// Returns the estimates that an input completes.
  std::vector<Estimate> process(const daemon::Input& input) {
    if (std::exchange(finished, finished || std::holds_alternative<daemon::EndOfInput>(input)))
      throw Error("an input after finish(); create another Odometry");
    engine.process(input);
    std::vector<Estimate> estimates(std::make_move_iterator(engine.completed().begin()),
                                    std::make_move_iterator(engine.completed().end()));
    engine.completed().clear();
    return estimates;
  }

  [[nodiscard]] SourceId source(std::string_view call, std::string_view name, SourceKind kind) const;
  [[nodiscard]] std::uint8_t cloud_lidar(std::string_view name) const;
};

namespace {

/// Applies the same bounds as to files: the difference of two differences of these fits.
Stamp stamp_of(std::string_view what, std::int64_t ns) {
  const Stamp stamp = stamp_from_ns(ns);
  if (stamp < kEarliestStamp || stamp > kLatestStamp)
    throw Error(fmt::format("{}: {} is not within 1951 and 2096; pass nanoseconds since 1970", what, ns));
  return stamp;
}

Eigen::Quaterniond rotation_of(std::string_view call, const std::array<double, 4>& xyzw) {
  const std::optional<Eigen::Quaterniond> rotation = unit_quaternion(xyzw[3], xyzw[0], xyzw[1], xyzw[2]);
  if (!rotation)
    throw Error(fmt::format("{}: orientation_xyzw is not a unit quaternion; its order is x, y, z, w", call));
  return *rotation;
}

Eigen::Vector3d vector_of(const std::array<double, 3>& v) { return {v[0], v[1], v[2]}; }

std::string names_of_all(const auto& named) {
  std::string names;
  for (const auto& each : named)
    names += (names.empty() ? "" : ", ") + each.name;
  return names.empty() ? "none" : names;
}

} // namespace

SourceId Odometry::Implementation::source(std::string_view call, std::string_view name, SourceKind kind) const {
  const std::vector<MotionSource>& sources = engine.config().motion_sources;
  const auto found = std::ranges::find(sources, name, &MotionSource::name);
  if (found == sources.end())
    throw Error(fmt::format("{}: no motion source {} is configured; there is {}", call, name, names_of_all(sources)));
  if (found->kind != kind)
    throw Error(fmt::format("{}: motion source {} is of kind {}; use {}()", call, name, to_string(found->kind),
                            to_string(found->kind)));
  return SourceId{static_cast<std::size_t>(found - sources.begin())};
}

std::uint8_t Odometry::Implementation::cloud_lidar(std::string_view name) const {
  const std::vector<LidarOptions>& lidars = engine.config().lidars;
  const auto found = std::ranges::find(lidars, name, &LidarOptions::name);
  if (found == lidars.end())
    throw Error(fmt::format("cloud: no lidar {} is configured; there is {}", name, names_of_all(lidars)));
  if (!found->gives_clouds())
    throw Error(fmt::format("cloud: lidar {0} receives packets; for clouds set lidars.{0}.topic=/points", name));
  return static_cast<std::uint8_t>(found - lidars.begin());
}

Odometry::Odometry(const std::filesystem::path& yaml_file, const std::vector<std::string>& overrides) {
  library::in_words_of_the_library(
      [&] { implementation_ = std::make_unique<Implementation>(tools::read_configuration(yaml_file, overrides)); });
}

Odometry::~Odometry() = default;
Odometry::Odometry(Odometry&& other) noexcept = default;
Odometry& Odometry::operator=(Odometry&& other) noexcept = default;

std::vector<Estimate> Odometry::packet(std::span<const std::byte> payload, std::int64_t arrival_ns, std::uint16_t port,
                                       std::uint32_t source_ip) {
  Datagram datagram;
  datagram.payload = payload;
  datagram.receive_stamp = stamp_of("packet: arrival_ns", arrival_ns);
  datagram.destination_port = port;
  datagram.source_ip = source_ip;
  return implementation_->process(datagram);
}

std::vector<Estimate> Odometry::cloud(std::string_view lidar, const Cloud& cloud) {
  const std::uint8_t index = implementation_->cloud_lidar(lidar);
  library::check_lengths(cloud);
  stamp_of("cloud: stamp_ns", cloud.stamp_ns);
  const Stamp arrival = stamp_of("cloud: arrival_ns", cloud.arrival_ns);
  if (library::points_of(cloud) > kMaxCloudPoints)
    return implementation_->process(daemon::CloudInput{index, nullptr, arrival, CloudError::too_large});
  return implementation_->process(daemon::CloudInput{index, &implementation_->cloud.make(cloud), arrival, {}});
}

std::vector<Estimate> Odometry::imu(std::string_view source, const ImuSample& sample) {
  const SourceId id = implementation_->source("imu", source, SourceKind::imu);
  daemon::ImuInput input{id,
                         {stamp_of("imu: stamp_ns", sample.stamp_ns),
                          stamp_of("imu: arrival_ns", sample.arrival_ns),
                          vector_of(sample.angular_velocity_radps),
                          vector_of(sample.specific_force_mps2),
                          {}}};
  if (sample.orientation_xyzw)
    input.sample.attitude = rotation_of("imu", *sample.orientation_xyzw);
  return implementation_->process(input);
}

std::vector<Estimate> Odometry::odometry(std::string_view source, const OdometrySample& sample) {
  const SourceId id = implementation_->source("odometry", source, SourceKind::odometry);
  return implementation_->process(
      daemon::OdometryInput{id,
                            {stamp_of("odometry: stamp_ns", sample.stamp_ns),
                             stamp_of("odometry: arrival_ns", sample.arrival_ns),
                             {rotation_of("odometry", sample.orientation_xyzw), vector_of(sample.position_m)},
                             sample.covariance_scale}});
}

std::vector<Estimate> Odometry::finish() { return implementation_->process(daemon::EndOfInput{}); }

std::vector<Surface> Odometry::scan() const { return implementation_->engine.scan(); }
std::vector<Surface> Odometry::map() const { return implementation_->engine.map(); }
std::string Odometry::figures_json() const { return library::to_json_text(implementation_->engine.figures()); }

} // namespace liblocus
