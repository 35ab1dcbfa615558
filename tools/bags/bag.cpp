// SPDX-License-Identifier: Apache-2.0
#include "bags/bag.hpp"

#include <algorithm>
#include <array>
#include <fstream>
#include <string_view>
#include <system_error>

#include "bags/ros1_bag.hpp"
#include "bags/ros2_bag.hpp"

namespace locus::tools {
namespace {

bool is_ros1_bag(const std::filesystem::path& file) {
  std::array<char, 7> start{};
  std::ifstream{file, std::ios::binary}.read(start.data(), start.size());
  const std::string name = file.filename().string();
  return std::string_view(start.data(), start.size()) == "#ROSBAG" || name.ends_with(".bag") ||
         name.ends_with(".bag.active");
}

} // namespace

std::size_t Bag::topic_index(const std::string& name, const std::string& type) {
  const auto found = std::ranges::find_if(topics_, [&](const BagTopic& t) { return t.name == name && t.type == type; });
  if (found != topics_.end())
    return static_cast<std::size_t>(found - topics_.begin());
  topics_.push_back({name, type});
  return topics_.size() - 1;
}

bool looks_like_bag(const std::filesystem::path& where) {
  std::error_code ignored;
  if (std::filesystem::is_directory(where, ignored))
    return is_ros2_bag_folder(where);
  return std::filesystem::is_regular_file(where, ignored) && (is_ros1_bag(where) || is_ros2_bag_file(where));
}

Expected<std::unique_ptr<Bag>, std::string> open_bag(const std::filesystem::path& where) {
  std::error_code ignored;
  if (std::filesystem::is_regular_file(where, ignored) && is_ros1_bag(where))
    return Ros1Bag::open(where);
  return Ros2Bag::open(where);
}

} // namespace locus::tools
