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

namespace locus {
namespace {

constexpr std::uint32_t kFirstMulticastIp = 0xE000'0000;

bool is_word(std::string_view text, std::string_view punctuation) {
  return !text.empty() && std::isalpha(static_cast<unsigned char>(text.front())) != 0 &&
         std::all_of(text.begin(), text.end(), [&](unsigned char c) {
           return std::isalnum(c) != 0 || punctuation.find(static_cast<char>(c)) != std::string_view::npos;
         });
}

/// ROS 2's rule for absolute names: /word/word.
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
                   "'" + topic + "' is no topic; write it as /words/of_letters_and_digits");
}

std::string item(const char* list, std::size_t index, const char* key) {
  return std::string{list} + '.' + std::to_string(index) + '.' + key;
}

/// Names are keys of the figures and words of the command line: one meaning each, over lidars and sources together.
void check_names(Problems& problems, const Config& config) {
  std::set<std::string_view> taken{"total", "all-lidars", "kernel_drops"};
  const auto check = [&](const std::string& key, std::string_view name) {
    problems.require(is_word(name, "_-"), key,
                     fmt::format("'{}' is no name; write a letter, then letters, digits, _ or -", name));
    problems.require(taken.insert(name).second, key, fmt::format("'{}' is taken, each name may stand once", name));
  };
  for (std::size_t i = 0; i < config.lidars.size(); ++i)
    check(item("lidars", i, "name"), config.lidars[i].name);
  for (std::size_t i = 0; i < config.motion_sources.size(); ++i)
    check(item("motion_sources", i, "name"), config.motion_sources[i].name);
}

void check_lidars(Problems& problems, const std::vector<LidarOptions>& lidars) {
  problems.require(!lidars.empty() && lidars.size() <= Config::kMaxLidars, "lidars", "there must be 1 to 16 of them");
  for (std::size_t i = 0; i < lidars.size(); ++i) {
    problems.require(lidars[i].port != 0, item("lidars", i, "port"), "0 is outside 1 .. 65535");
    problems.require(lidars[i].multicast_ip.value_or(kFirstMulticastIp) >> 28 == kFirstMulticastIp >> 28,
                     item("lidars", i, "multicast_ip"), "must be within 224.0.0.0 .. 239.255.255.255, or none");
    const bool heard_twice = std::any_of(lidars.begin(), lidars.begin() + static_cast<std::ptrdiff_t>(i),
                                         [&lidar = lidars[i]](const LidarOptions& other) {
                                           return other.port == lidar.port && (!other.source_ip || !lidar.source_ip ||
                                                                               *other.source_ip == *lidar.source_ip);
                                         });
    problems.require(!heard_twice, item("lidars", i, "port"),
                     "is another lidar's too; give each its own port, or each its own source_ip");
  }
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
  }
}

/// DDS hands the messages of a topic to those who expect their type, and to nobody else without a word.
void check_types_of_topics(Problems& problems, const Config& config) {
  std::map<std::string_view, std::string_view> types;
  const auto check = [&](const std::string& key, std::string_view topic, std::string_view type) {
    const std::string_view first = topic.empty() ? type : types.try_emplace(topic, type).first->second;
    problems.require(
        first == type, key,
        fmt::format("'{}' cannot carry {} here and {} elsewhere; give each a topic of its own", topic, type, first));
  };
  for (std::size_t i = 0; i < config.motion_sources.size(); ++i) {
    const MotionSource& source = config.motion_sources[i];
    check(item("motion_sources", i, "topic"), source.topic, source.kind == SourceKind::imu ? "Imu" : "Odometry");
    check(item("motion_sources", i, "health_topic"), source.health_topic, "Bool");
  }
  check("dds.flat_ground_topic", config.dds.flat_ground_topic, "Bool");
}

void check_realtime(Problems& problems, const RealtimeOptions& realtime) {
  problems.require_range("realtime.priority", realtime.priority, 0, 99);
  for (const int cpu : realtime.cpus)
    problems.require_range("realtime.cpus", cpu, 0, 1023);
}

void check_dds(Problems& problems, const DdsOptions& dds) {
  problems.require_range("dds.domain", dds.domain, 0, 232);
  problems.require(is_word(dds.interface, "_-.:@") && dds.interface.size() < IFNAMSIZ, "dds.interface",
                   "must name a network interface, e.g. lo or eth0");
  problems.require(!dds.frame_odom.empty(), "dds.frame_odom", "must not be empty");
  problems.require(!dds.frame_base.empty() && dds.frame_base != dds.frame_odom, "dds.frame_base",
                   "must not be empty and must differ from frame_odom");
  require_topic_or_empty(problems, "dds.prefix", dds.prefix);
  require_topic_or_empty(problems, "dds.flat_ground_topic", dds.flat_ground_topic);
}

/// A name of a source is that of its file.
void check_record(Problems& problems, const Config& config) {
  const std::vector<MotionSource>& sources = config.motion_sources;
  for (std::size_t i = 0; i < sources.size() && !config.record.folder.empty(); ++i)
    problems.require(sources[i].kind == SourceKind::imu || (sources[i].name != "gt" && sources[i].name != "imu"),
                     item("motion_sources", i, "name"),
                     fmt::format("{}.tum has another meaning in a recording; rename the source", sources[i].name));
  const std::filesystem::path folder = config.record.folder;
  problems.require(std::find(folder.begin(), folder.end(), "..") == folder.end(), "record.folder",
                   "must not contain '..'; write the whole path");
  problems.require_range<std::uint64_t>("record.max_bytes", config.record.max_bytes, 10'000'000, 1'000'000'000'000'000);
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
  return problems.result();
}

void Config::use(Isa isa) {
  for (LidarOptions& lidar : lidars)
    lidar.isa = isa;
  sweep.isa = odometry.isa = isa;
}

} // namespace locus
