// SPDX-License-Identifier: Apache-2.0
#include "config/config_proposal.hpp"

#include <algorithm>
#include <cctype>
#include <string_view>
#include <utility>

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include "config/config_yaml.hpp"

namespace locus {
namespace {

YAML::Node tree_of(const Config& config) { return YAML::Load(print_config(config)); }

std::string text_of(const YAML::Node& node) {
  YAML::Emitter emitter;
  emitter << YAML::Flow << node;
  return {emitter.c_str(), emitter.size()};
}

/// Formats the end of a line; names in a recording may contain anything.
std::string comment(std::string reason) {
  std::ranges::replace_if(
      reason, [](unsigned char c) { return std::iscntrl(c) != 0; }, '?');
  return reason.empty() ? "\n" : fmt::format("  # {}\n", reason);
}

/// Beginnings of the lines of a list item.
struct Margin {
  std::string_view first, next;
};
constexpr Margin kUsed{"  - ", "    "};
constexpr Margin kNotUsed{"  # - ", "  #   "};

class Proposal {
 public:
  explicit Proposal(const ConfigReasons& reasons) : reasons_(reasons) {}

  /// Adds a list; `defaults` are those of an item.
  void add_list(const std::string& name, const YAML::Node& items, const YAML::Node& others,
                const std::vector<std::string>& why_not, const YAML::Node& defaults) {
    text_ += items.size() > 0 ? name + ":\n" : name + ": []" + comment(reason(name, false));
    for (std::size_t i = 0; i < items.size(); ++i)
      add_item(fmt::format("{}.{}", name, i), items[i], defaults, kUsed, "");
    for (std::size_t i = 0; i < others.size(); ++i)
      add_item("", others[i], defaults, kNotUsed, why_not[i]);
  }

  /// Adds a top-level key or section as far as it differs from its default.
  void add_changes(const std::string& name, const YAML::Node& value, const YAML::Node& usual) {
    if (text_of(value) == text_of(usual))
      return;
    if (!value.IsMap()) {
      text_ += fmt::format("{}: {}{}", name, text_of(value), comment(reason(name, true)));
      return;
    }
    text_ += name + ":\n";
    for (const auto& entry : value) {
      const std::string key = entry.first.Scalar();
      if (text_of(entry.second) != text_of(usual[key]))
        text_ += fmt::format("  {}: {}{}", key, text_of(entry.second), comment(reason(name + '.' + key, true)));
    }
  }

  [[nodiscard]] std::string release() { return std::move(text_); }

 private:
  [[nodiscard]] std::string reason(const std::string& path, bool is_changed) const {
    const auto found = reasons_.of_key.find(path);
    if (found != reasons_.of_key.end())
      return found->second;
    return is_changed ? reasons_.of_other_keys : "";
  }

  /// Adds the name of an item, its kind, the keys that differ from their defaults, and those with a reason.
  void add_item(const std::string& path, const YAML::Node& item, const YAML::Node& defaults, const Margin& margin,
                const std::string& why_not) {
    std::string_view begin = margin.first;
    for (const auto& entry : item) {
      const std::string key = entry.first.Scalar(), value = text_of(entry.second), where = path + '.' + key;
      const bool is_identity = key == "name" || key == "kind";
      const bool is_changed = !is_identity && value != text_of(defaults[key]);
      if (!is_identity && !is_changed && !reasons_.of_key.contains(where))
        continue;
      std::string why = path.empty() ? "" : reason(where, is_changed);
      if (path.empty() && key == "name")
        why = "not used: " + why_not;
      text_ += fmt::format("{}{}: {}{}", begin, key, value, comment(std::move(why)));
      begin = margin.next;
    }
  }

  const ConfigReasons& reasons_;
  std::string text_;
};

/// Stores the candidates in `items`, and returns their reasons.
template <class Item>
std::vector<std::string> split(const std::vector<ConfigReasons::Candidate<Item>>& candidates,
                               std::vector<Item>& items) {
  std::vector<std::string> reasons;
  items.clear();
  for (const auto& candidate : candidates) {
    items.push_back(candidate.item);
    reasons.push_back(candidate.reason);
  }
  return reasons;
}

} // namespace

void leave_out_source(std::size_t index, const std::string& why, Config& config, ConfigReasons& reasons) {
  const auto source = config.motion_sources.begin() + static_cast<std::ptrdiff_t>(index);
  if (!why.empty())
    reasons.other_sources.push_back({*source, why});
  config.motion_sources.erase(source);
  std::map<std::string, std::string> of_key;
  for (auto& [path, reason] : reasons.of_key) {
    std::size_t of = index, end = 0;
    constexpr std::string_view kList = "motion_sources.";
    if (!path.starts_with(kList) || (of = std::stoul(path.substr(kList.size()), &end)) < index)
      of_key[path] = std::move(reason);
    else if (of > index)
      of_key[fmt::format("{}{}{}", kList, of - 1, path.substr(kList.size() + end))] = std::move(reason);
  }
  reasons.of_key = std::move(of_key);
}

std::string print_proposal(const Config& config, const ConfigReasons& reasons) {
  Config defaults, others;
  defaults.lidars = {LidarOptions{}};
  defaults.motion_sources = {MotionSource{}};
  const std::vector<std::string> not_lidars = split(reasons.other_lidars, others.lidars);
  const std::vector<std::string> not_sources = split(reasons.other_sources, others.motion_sources);
  const YAML::Node tree = tree_of(config), usual = tree_of(defaults), other = tree_of(others);
  Proposal proposal(reasons);
  for (const auto& [list, why_not] : {std::pair{"lidars", not_lidars}, std::pair{"motion_sources", not_sources}})
    proposal.add_list(list, tree[list], other[list], why_not, usual[list][0]);
  for (const auto& entry : tree) {
    if (const std::string key = entry.first.Scalar(); key != "lidars" && key != "motion_sources")
      proposal.add_changes(key, entry.second, usual[key]);
  }
  return proposal.release();
}

} // namespace locus
