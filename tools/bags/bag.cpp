// SPDX-License-Identifier: Apache-2.0
#include "bags/bag.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <fstream>
#include <string_view>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

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

std::optional<std::size_t> Bag::index_of(BagTopic topic) {
  if (const auto known = indices_.find(topic); known != indices_.end())
    return known->second;
  if (topics_.size() == kMaxTopics || topic.name.size() > kMaxNameBytes || topic.type.size() > kMaxNameBytes) {
    is_beyond_bounds_ = true;
    return std::nullopt;
  }
  topics_.push_back(topic);
  indices_.emplace(std::move(topic), topics_.size() - 1);
  return topics_.size() - 1;
}

void Bag::declare(std::int64_t number, BagTopic topic) {
  const bool has_room = declared_.size() < kMaxTopics || declared_.contains(number);
  is_beyond_bounds_ = is_beyond_bounds_ || !has_room;
  const std::optional<std::size_t> index = has_room ? index_of(std::move(topic)) : std::nullopt;
  if (index)
    declared_[number] = *index;
  else
    declared_.erase(number);
}

std::optional<std::size_t> Bag::topic_of(std::int64_t number) const {
  const auto found = declared_.find(number);
  return found != declared_.end() ? std::optional(found->second) : std::nullopt;
}

void Bag::add_bound_warnings(const std::string& file, std::vector<std::string>& lines) const {
  if (is_beyond_bounds_)
    lines.push_back(fmt::format("{}: topics beyond the {}th, or with a name or type of more than {} bytes, are "
                                "skipped; copy or record it again",
                                file, kMaxTopics, kMaxNameBytes));
}

std::string ros1_type(std::string type) {
  if (const std::size_t middle = type.find("/msg/"); middle != std::string::npos)
    type.erase(middle, 4);
  return type;
}

std::string printable(std::string_view text) {
  constexpr std::size_t kShown = 20;
  std::string shown{text.substr(0, kShown)};
  std::ranges::replace_if(
      shown, [](char c) { return c < ' ' || c > '~'; }, '?');
  return shown;
}

std::optional<std::string> why_unreadable(const std::filesystem::path& file) {
  const int descriptor = open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (descriptor >= 0) {
    close(descriptor);
    return std::nullopt;
  }
  return fmt::format("cannot be read ({}); {}", std::generic_category().message(errno),
                     errno == EMFILE ? "allow more with: ulimit -n 65536" : "check its permissions");
}

std::string timeless_messages(const std::string& file, std::uint64_t count) {
  return fmt::format("{}: {} messages with an absurd time of reception were skipped; record again if they matter", file,
                     count);
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
