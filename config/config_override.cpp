// SPDX-License-Identifier: Apache-2.0
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "config/config_mistakes.hpp"
#include "config/config_tree.hpp"
#include "config/config_yaml.hpp"

namespace locus {
namespace {

/// One --set option and its path in the tree.
struct Override {
  std::string assignment;
  std::string path; ///< with list items by index
};

/// Finds a list item by its index or its name.
std::optional<std::size_t> find_item(const YAML::Node& list, const std::string& name_or_index) {
  for (std::size_t i = 0; i < list.size(); ++i)
    if (name_or_index == std::to_string(i) || (list[i].IsMap() && list[i]["name"].as<std::string>("") == name_or_index))
      return i;
  return std::nullopt;
}

/// Descends from `node` along one part of a dotted path. Returns the mistake, if any.
std::optional<std::string> descend(YAML::Node& node, std::string& path, const std::string& part) {
  if (node.IsMap()) {
    std::vector<std::string_view> keys;
    for (const auto& entry : node)
      keys.push_back(entry.first.Scalar());
    if (std::find(keys.begin(), keys.end(), part) == keys.end())
      return join(path, part) + ": " + unknown_key(part, keys);
    path = join(path, part);
    node.reset(node[part]);
    return std::nullopt;
  }
  if (node.IsSequence()) {
    const auto index = find_item(node, part);
    if (!index)
      return path + " has no item '" + part + "'; use a name or an index below " + std::to_string(node.size());
    path = join(path, std::to_string(*index));
    node.reset(node[*index]);
    return std::nullopt;
  }
  return path + " has no keys below it";
}

/// Stores the value of one --set option in the tree. Returns the mistake, if any.
std::optional<std::string> assign(const YAML::Node& tree, Override& override) {
  const std::size_t equals = override.assignment.find('=');
  if (equals == std::string::npos || equals == 0)
    return "must be KEY=VALUE, e.g. lidars.front.port=2369";
  YAML::Node node = tree;
  for (const std::string& part : split_at(override.assignment.substr(0, equals), '.'))
    if (auto problem = descend(node, override.path, part))
      return problem;
  try {
    node = YAML::Load(override.assignment.substr(equals + 1));
  } catch (const std::exception&) {
    return "the value is not YAML";
  }
  return std::nullopt;
}

/// Returns the option that violates the rule of a key: the last one that set the key or a key below or around it.
const Override& culprit(const std::vector<Override>& overrides, const std::string& path) {
  const auto related = std::find_if(overrides.rbegin(), overrides.rend(), [&](const Override& override) {
    return contains(override.path, path) || contains(path, override.path);
  });
  return related == overrides.rend() ? overrides.back() : *related;
}

} // namespace

bool sets_key(const std::filesystem::path& file, const std::string& path) {
  YAML::Node node = YAML::LoadFile(file.string());
  std::string known;
  const std::vector<std::string> parts = split_at(path, '.');
  return std::all_of(parts.begin(), parts.end(),
                     [&](const std::string& part) { return !descend(node, known, part).has_value(); });
}

Expected<Config, ConfigErrors> override_config(const Config& config, std::span<const std::string> assignments) {
  Config changed = config;
  std::vector<Override> overrides;
  std::vector<Mistake> unreadable;
  ConfigErrors errors;
  const auto blame = [&](const Override& override, const std::string& what) {
    errors.push_back(error_line("--set " + override.assignment, what));
  };
  for (const std::string& assignment : assignments) {
    Override& override = overrides.emplace_back(Override{assignment, ""});
    const YAML::Node tree = to_tree(changed);
    if (const auto problem = assign(tree, override)) {
      blame(override, *problem);
      continue;
    }
    for (Mistake& mistake : read_tree(tree, changed)) {
      blame(override, text_of(mistake));
      unreadable.push_back(std::move(mistake));
    }
  }
  const auto problems = changed.problem();
  if (problems && !overrides.empty())
    for (const std::string& problem : split_at(*problems, '\n'))
      if (!is_blamed(unreadable, path_of(problem)))
        blame(culprit(overrides, path_of(problem)), problem);
  if (!errors.empty())
    return errors;
  return changed;
}

} // namespace locus
