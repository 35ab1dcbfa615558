// SPDX-License-Identifier: Apache-2.0
#include "config/config.hpp"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <map>
#include <set>
#include <string_view>

#include <fmt/format.h>
#include <net/if.h>

#include "core/base/problems.hpp"
#include "core/ingest/sweep.hpp"
#include "drivers/net/socket_address.hpp"

namespace locus {
namespace {

constexpr std::uint32_t kFirstMulticastIp = 0xE000'0000;

bool is_word(std::string_view text, std::string_view punctuation) {
  return !text.empty() && std::isalpha(static_cast<unsigned char>(text.front())) != 0 &&
         std::all_of(text.begin(), text.end(), [&](unsigned char c) {
           return std::isalnum(c) != 0 || punctuation.find(static_cast<char>(c)) != std::string_view::npos;
         });
}

/// Checks ROS 2's rule for absolute names: /word/word.
bool is_topic(std::string_view text) {
  while (text.starts_with('/')) {
    text.remove_prefix(1);
    const std::string_view word = text.substr(0, text.find('/'));
    if (!is_word(word, "_"))
      return false;
    text.remove_prefix(word.size());
    if (text.empty())
      return true;
  }
  return false;
}

void require_topic_or_empty(Problems& problems, const std::string& key, const std::string& topic) {
  problems.require(topic.empty() || is_topic(topic), key,
                   "'" + topic + "' is not a topic; write it as /words/of_letters_and_digits");
}

std::string item(const char* list, std::size_t index, const char* key) {
  return std::string{list} + '.' + std::to_string(index) + '.' + key;
}

/// Checks names, which serve as keys of figures and as command-line words: unique over lidars and sources together.
void check_names(Problems& problems, const Config& config) {
  std::set<std::string_view> taken{"total", "all-lidars", "kernel_drops"};
  const auto check = [&](const std::string& key, std::string_view name) {
    problems.require(is_word(name, "_-"), key,
                     fmt::format("'{}' is not a name; write a letter, then letters, digits, _ or -", name));
    problems.require(taken.insert(name).second, key, fmt::format("'{}' is taken, each name may stand once", name));
  };
  for (std::size_t i = 0; i < config.lidars.size(); ++i)
    check(item("lidars", i, "name"), config.lidars[i].name);
  for (std::size_t i = 0; i < config.motion_sources.size(); ++i)
    check(item("motion_sources", i, "name"), config.motion_sources[i].name);
}

/// Checks lidars that publish clouds: keys about packets do not apply, since another driver has decoded them.
void check_clouds(Problems& problems, const std::vector<LidarOptions>& lidars, std::size_t i) {
  static const LidarOptions kDefaults;
  const LidarOptions& lidar = lidars[i];
  require_topic_or_empty(problems, item("lidars", i, "topic"), lidar.topic);
  if (!lidar.gives_clouds()) {
    problems.require(lidar.point_times == kDefaults.point_times, item("lidars", i, "point_times"),
                     "belongs to clouds; name their topic, or leave it out");
    return;
  }
  const auto require_default = [&](const char* key, bool is_default) {
    problems.require(is_default, item("lidars", i, key),
                     fmt::format("belongs to packets, and topic {} to clouds; leave out one of the two", lidar.topic));
  };
  require_default("model", !lidar.model && !lidar.hesai);
  require_default("port", lidar.port == kDefaults.port || lidar.port == 0);
  require_default("source_ip", lidar.source_ip == kDefaults.source_ip);
  require_default("multicast_ip", lidar.multicast_ip == kDefaults.multicast_ip);
  require_default("time", lidar.time == kDefaults.time);
  require_default("calibration", lidar.calibration == kDefaults.calibration);
  require_default("metadata", lidar.metadata == kDefaults.metadata);
  const auto end = lidars.begin() + static_cast<std::ptrdiff_t>(i);
  problems.require(
      std::find_if(lidars.begin(), end, [&](const LidarOptions& other) { return other.topic == lidar.topic; }) == end,
      item("lidars", i, "topic"), "is also that of another lidar; configure a different one for each");
}

void check_lidars(Problems& problems, const std::vector<LidarOptions>& lidars) {
  problems.require(!lidars.empty() && lidars.size() <= kMaxLidars, "lidars", "there must be 1 to 16 of them");
  for (std::size_t i = 0; i < lidars.size(); ++i) {
    check_clouds(problems, lidars, i);
    problems.require(lidars[i].port != 0 || lidars[i].is_ouster(), item("lidars", i, "port"),
                     "0 is outside 1 .. 65535");
    problems.require(lidars[i].multicast_ip.value_or(kFirstMulticastIp) >> 28 == kFirstMulticastIp >> 28,
                     item("lidars", i, "multicast_ip"), "must be within 224.0.0.0 .. 239.255.255.255, or none");
    problems.require((!lidars[i].model && !lidars[i].hesai) || lidars[i].metadata.empty(),
                     item("lidars", i, "metadata"), "belongs to model Ouster, or auto");
    const bool is_ambiguous =
        std::any_of(lidars.begin(), lidars.begin() + static_cast<std::ptrdiff_t>(i),
                    [&lidar = lidars[i]](const LidarOptions& other) {
                      return !other.gives_clouds() && !lidar.gives_clouds() && other.port == lidar.port &&
                             lidar.port != 0 &&
                             (!other.source_ip || !lidar.source_ip || *other.source_ip == *lidar.source_ip);
                    });
    problems.require(!is_ambiguous, item("lidars", i, "port"),
                     "is also that of another lidar; configure separate ports, or a source_ip for each");
  }
}

void check_calibration(Problems& problems, std::size_t i, const MotionSource& source) {
  const bool imu = source.kind == SourceKind::imu;
  const auto check = [&](const char* key, double value, double lowest, double highest, bool belongs, const char* kind) {
    const std::string name = item("motion_sources", i, key);
    problems.require_range(name, value, lowest, highest);
    problems.require(belongs, name, fmt::format("belongs to kind {} alone", kind));
  };
  check("late_ms", source.late_ms, -250.0, 250.0, true, "");
  check("scale", source.scale, 0.5, 2.0, !imu || source.scale == 1.0, "odometry");
  check("yaw_scale", source.yaw_scale, 0.5, 2.0, !imu || source.yaw_scale == 1.0, "odometry");
  const CalibrationSigma& sigma = source.calibration_sigma;
  check("calibration_sigma.late_ms", sigma.late_ms.value_or(0.0), 0.0, 250.0, imu || !sigma.late_ms, "imu");
  check("calibration_sigma.mounting_deg", sigma.mounting_deg.value_or(0.0), 0.0, 45.0, imu || !sigma.mounting_deg,
        "imu");
  check("calibration_sigma.scale", sigma.scale.value_or(0.0), 0.0, 0.5, !imu || !sigma.scale, "odometry");
  check("calibration_sigma.yaw_scale", sigma.yaw_scale.value_or(0.0), 0.0, 0.5, !imu || !sigma.yaw_scale, "odometry");
}

void check_sources(Problems& problems, const Config& config) {
  problems.require(config.motion_sources.size() <= kMaxSources, "motion_sources",
                   "there may be " + std::to_string(kMaxSources) + " at most");
  for (std::size_t i = 0; i < config.motion_sources.size(); ++i) {
    const MotionSource& source = config.motion_sources[i];
    require_topic_or_empty(problems, item("motion_sources", i, "topic"), source.topic);
    require_topic_or_empty(problems, item("motion_sources", i, "health_topic"), source.health_topic);
    problems.require(source.kind == SourceKind::imu || source.T_base_source == Pose{},
                     item("motion_sources", i, "T_base_source"),
                     "belongs to kind imu alone, an odometry source already reports the pose of the base");
    problems.require(source.kind == SourceKind::imu || source.use_acceleration == UseAcceleration::automatic,
                     item("motion_sources", i, "use_acceleration"), "belongs to kind imu alone");
    check_calibration(problems, i, source);
  }
}

/// Checks that each topic has one type: DDS silently delivers nothing to a reader of another type.
void check_types_of_topics(Problems& problems, const Config& config) {
  std::map<std::string_view, std::string_view> types;
  const auto check = [&](const std::string& key, std::string_view topic, std::string_view type) {
    const std::string_view first = topic.empty() ? type : types.try_emplace(topic, type).first->second;
    problems.require(first == type, key,
                     fmt::format("'{}' cannot have {} here and {} elsewhere; use separate topics", topic, type, first));
  };
  for (std::size_t i = 0; i < config.motion_sources.size(); ++i) {
    const MotionSource& source = config.motion_sources[i];
    check(item("motion_sources", i, "topic"), source.topic, source.kind == SourceKind::imu ? "Imu" : "Odometry");
    check(item("motion_sources", i, "health_topic"), source.health_topic, "Bool");
  }
  for (std::size_t i = 0; i < config.lidars.size(); ++i)
    check(item("lidars", i, "topic"), config.lidars[i].topic, "PointCloud2");
  check("dds.flat_ground_topic", config.dds.flat_ground_topic, "Bool");
}

void check_realtime(Problems& problems, const RealtimeOptions& realtime) {
  problems.require_range("realtime.priority", realtime.priority, 0, 99);
  for (const int cpu : realtime.cpus)
    problems.require_range("realtime.cpus", cpu, 0, 1023);
}

/// Checks the name of a frame: tf2 rejects a slash at its beginning, and no blank ever matches.
void check_frame(Problems& problems, const std::string& key, const std::string& frame, const std::string& usual) {
  std::string usable = frame;
  std::erase_if(usable, [](unsigned char c) { return c <= ' ' || c == 0x7F; });
  usable.erase(0, usable.find_first_not_of('/'));
  problems.require(frame == usable && !frame.empty(), key,
                   fmt::format("must be a name without blanks, and without a slash at its beginning; write {}",
                               usable.empty() ? usual : usable));
}

void check_dds(Problems& problems, const DdsOptions& dds) {
  problems.require_range("dds.domain", dds.domain, 0, 232);
  problems.require(is_word(dds.interface, "_-.:@") && dds.interface.size() < IFNAMSIZ, "dds.interface",
                   "must name a network interface, e.g. lo or eth0");
  check_frame(problems, "dds.frame_odom", dds.frame_odom, DdsOptions{}.frame_odom);
  check_frame(problems, "dds.frame_base", dds.frame_base, DdsOptions{}.frame_base);
  problems.require(dds.frame_base != dds.frame_odom, "dds.frame_base", "must differ from frame_odom");
  require_topic_or_empty(problems, "dds.prefix", dds.prefix);
  require_topic_or_empty(problems, "dds.flat_ground_topic", dds.flat_ground_topic);
}

/// Checks the recording, in which a source's name is also its file name.
void check_record(Problems& problems, const Config& config) {
  const std::vector<MotionSource>& sources = config.motion_sources;
  for (std::size_t i = 0; i < sources.size() && !config.record.folder.empty(); ++i)
    problems.require(sources[i].kind == SourceKind::imu || (sources[i].name != "gt" && sources[i].name != "imu"),
                     item("motion_sources", i, "name"),
                     fmt::format("{}.tum has another meaning in a recording; rename the source", sources[i].name));
  const std::filesystem::path folder = config.record.folder;
  problems.require(std::find(folder.begin(), folder.end(), "..") == folder.end(), "record.folder",
                   "must not contain '..'; write the whole path");
  constexpr std::uint64_t kLeast = RecordOptions::kLeastBytes, kMost = 1'000'000'000'000'000;
  problems.require_range<std::uint64_t>("record.max_bytes", config.record.max_bytes, kLeast, kMost);
  const double keep_s = config.record.keep_s;
  problems.require(keep_s == 0.0 || (keep_s >= 1.0 && keep_s <= 600.0), "record.keep_s",
                   "must be 1 .. 600, or 0 to store no incidents");
  problems.require_range<std::uint64_t>("record.keep_bytes", config.record.keep_bytes, kLeast, 100'000'000'000);
  problems.require_range<std::uint64_t>("record.incidents_bytes", config.record.incidents_bytes, kLeast, kMost);
  problems.require(config.record.incidents_bytes >= config.record.keep_bytes, "record.incidents_bytes",
                   "must not be less than record.keep_bytes, for one incident may have as much");
}

void check_metrics(Problems& problems, const MetricsOptions& metrics) {
  problems.require(metrics.listen.empty() || parse_socket_address(metrics.listen).has_value(), "metrics.listen",
                   fmt::format("'{}' is not an address to listen on; write IPv4:PORT as 127.0.0.1:9464, [IPv6]:PORT as "
                               "[::1]:9464, or the absolute path of a Unix socket, of 107 bytes at most",
                               metrics.listen));
}

} // namespace

std::optional<std::string> Config::problem() const {
  Problems problems;
  problems.require(version == kVersion, "version",
                   fmt::format("this locusd reads version {}; see locusd.yaml(5)", kVersion));
  check_names(problems, *this);
  check_lidars(problems, lidars);
  check_sources(problems, *this);
  check_types_of_topics(problems, *this);
  problems.add(sweep.problem());
  problems.add(odometry.problem());
  check_realtime(problems, realtime);
  check_dds(problems, dds);
  check_record(problems, *this);
  check_metrics(problems, metrics);
  return problems.result();
}

void Config::use(Isa isa) {
  for (LidarOptions& lidar : lidars)
    lidar.isa = isa;
  sweep.isa = odometry.isa = isa;
}

} // namespace locus
