// SPDX-License-Identifier: Apache-2.0
// Configuration snippets of docs/nav2.md and docs/ros2.md for locusd and other programs: they parse, and contain the
// default topics and frames of locusd.
#include <gtest/gtest.h>

#include <array>
#include <fstream>
#include <iterator>
#include <map>
#include <regex>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>
#include <yaml-cpp/yaml.h>

#include "config/config_yaml.hpp"

namespace locus {
namespace {

std::string page(const std::string& name) {
  std::ifstream file{LOCUS_DOCS_DIR "/" + name};
  return {std::istreambuf_iterator<char>{file}, {}};
}

/// Returns the sections of a page, each with its heading.
std::vector<std::string> sections_of(const std::string& text) {
  std::vector<std::string> sections;
  for (std::size_t at = 0, next = 0; at != std::string::npos; at = next) {
    next = text.find("\n## ", at + 1);
    sections.push_back(text.substr(at, next - at));
  }
  return sections;
}

/// Returns the text between ```LANGUAGE and ```.
std::vector<std::string> snippets_of(const std::string& text, const std::string& language) {
  std::vector<std::string> snippets;
  const std::string begin = "\n```" + language + "\n", end = "\n```\n";
  for (std::size_t at = text.find(begin); at != std::string::npos; at = text.find(begin, at + 1)) {
    const std::size_t from = at + begin.size();
    snippets.push_back(text.substr(from, text.find(end, at + 1) - from + 1));
  }
  return snippets;
}

/// Calls `use(key, value)` for every value of a tree, with the key of the innermost map.
template <class Use> void for_each_value(const YAML::Node& node, const std::string& key, const Use& use) {
  if (node.IsMap())
    for (const auto& entry : node)
      for_each_value(entry.second, entry.first.as<std::string>(), use);
  else
    use(key, node);
}

bool is_of_locusd(const YAML::Node& root) { return root["dds"].IsDefined(); }

/// Returns the values of this key in a file of another program.
std::vector<std::string> values_of(const YAML::Node& root, const std::string& wanted) {
  std::vector<std::string> values;
  for_each_value(root, "", [&](const std::string& key, const YAML::Node& value) {
    if (key == wanted)
      values.push_back(value.as<std::string>());
  });
  return values;
}

/// Default values of locusd by the names that Nav2 and robot_localization use for these settings.
std::map<std::string, std::set<std::string>> values_by_default() {
  const DdsOptions dds;
  const std::set<std::string> odometry{dds.prefix + "/odometry"}, odom{dds.frame_odom}, base{dds.frame_base};
  return {{"odom_topic", odometry},
          {"odom0", odometry},
          {"topic", {dds.prefix + "/cloud"}},
          {"odom_frame", odom},
          {"odom_frame_id", odom},
          {"local_frame", odom},
          {"world_frame", odom},
          {"base_link_frame", base},
          {"base_frame_id", base},
          {"robot_base_frame", base},
          {"map_frame", {"map"}},
          {"global_frame_id", {"map"}},
          {"global_frame", {"map", dds.frame_odom}}};
}

TEST(RosPages, SnippetsForLocusdAreValid) {
  int found = 0;
  for (const char* name : {"nav2.md", "ros2.md"})
    for (const std::string& snippet : snippets_of(page(name), "yaml"))
      if (is_of_locusd(YAML::Load(snippet))) {
        const auto config = parse_config(snippet, name);
        EXPECT_TRUE(config) << snippet << (config ? "" : config.error().front());
        ++found;
      }
  EXPECT_GE(found, 3);
}

TEST(RosPages, SnippetsForOthersNameOurTopicsAndFrames) {
  const auto expected = values_by_default();
  std::set<std::string> seen;
  for (const std::string& snippet : snippets_of(page("nav2.md"), "yaml")) {
    const YAML::Node root = YAML::Load(snippet);
    if (is_of_locusd(root))
      continue;
    for_each_value(root, "", [&](const std::string& key, const YAML::Node& value) {
      if (const auto known = expected.find(key); known != expected.end()) {
        EXPECT_TRUE(known->second.contains(value.as<std::string>())) << key << ": " << value;
        seen.insert(key);
      }
    });
  }
  EXPECT_EQ(seen.size(), expected.size()) << "every setting is shown";
}

TEST(RosPages, LocalCostmapIsInTheOdomFrame) {
  for (const std::string& snippet : snippets_of(page("nav2.md"), "yaml"))
    if (const YAML::Node root = YAML::Load(snippet); root["local_costmap"].IsDefined()) {
      EXPECT_EQ(values_of(root["local_costmap"], "global_frame"), std::vector<std::string>{DdsOptions{}.frame_odom});
      EXPECT_EQ(values_of(root["global_costmap"], "global_frame"), std::vector<std::string>{"map"});
      return;
    }
  ADD_FAILURE() << "no local costmap";
}

/// In each section with files for locusd and an EKF exactly one publishes the transform; without an EKF it is locusd.
TEST(RosPages, OneNodePublishesTheTransform) {
  int found = 0;
  for (const std::string& section : sections_of(page("nav2.md"))) {
    int publishers = 0, files = 0;
    for (const std::string& snippet : snippets_of(section, "yaml")) {
      for (const std::string& publishes : values_of(YAML::Load(snippet), "publish_tf"))
        publishers += publishes == "true" ? 1 : 0;
      ++files;
    }
    EXPECT_TRUE(files == 0 || publishers == 1) << section;
    found += files > 0 ? 1 : 0;
  }
  EXPECT_EQ(found, 2);
}

/// robot_localization has 15 flags: x y z, roll pitch yaw, their rates, accelerations.
TEST(RosPages, EkfFusesThePoseOnce) {
  for (const std::string& snippet : snippets_of(page("nav2.md"), "yaml")) {
    const YAML::Node ekf = YAML::Load(snippet)["ekf_filter_node"]["ros__parameters"];
    if (!ekf.IsDefined())
      continue;
    const auto fused = ekf["odom0_config"].as<std::vector<bool>>();
    ASSERT_EQ(fused.size(), 15U);
    for (std::size_t i = 0; i < fused.size(); ++i)
      EXPECT_EQ(fused[i], i < 6) << i;
    EXPECT_FALSE(ekf["odom1"].IsDefined() || ekf["imu0"].IsDefined());
    return;
  }
  ADD_FAILURE() << "no EKF";
}

TEST(RosPages, BridgeAllowsWhatLocusdPublishes) {
  const std::vector<std::string> snippets = snippets_of(page("nav2.md"), "json");
  ASSERT_EQ(snippets.size(), 1U);
  const nlohmann::json bridge = nlohmann::json::parse(snippets.front()).at("plugins").at("ros2dds");
  EXPECT_NE(page("nav2.md").find("domain: " + std::to_string(bridge.at("domain").get<int>())), std::string::npos);
  const std::string prefix = DdsOptions{}.prefix;
  for (const std::string& topic :
       {prefix + "/odometry", prefix + "/state", prefix + "/cloud", std::string{"/tf"}, std::string{"/diagnostics"}}) {
    bool allowed = false;
    for (const nlohmann::json& pattern : bridge.at("allow").at("publishers"))
      allowed = allowed || std::regex_match(topic, std::regex(pattern.get<std::string>()));
    EXPECT_TRUE(allowed) << topic;
  }
  for (const nlohmann::json& limit : bridge.at("pub_max_frequencies"))
    EXPECT_TRUE(limit.get<std::string>().starts_with(prefix + "/")) << limit;
}

} // namespace
} // namespace locus
