// SPDX-License-Identifier: Apache-2.0
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "config/config_fields.hpp"
#include "config/config_tree.hpp"
#include "config/yaml_values.hpp"

namespace locus {
namespace {

/// Reads a YAML tree into structs and stores the line of every key.
class Reading {
 public:
  /// Reads a section with fields() into `value`; fields without a key stay unchanged.
  template <class T> void read_section(const YAML::Node& node, const std::string& path, int line, T& value);

  template <class T> void read(const YAML::Node& node, const std::string& path, int line, T& value) {
    lines_[path] = line;
    if constexpr (HasFields<T>)
      read_section(node, path, line, value);
    else if (const auto reason = parse(node, value))
      blame(path, line, *reason);
  }
  template <class T> void read(const YAML::Node& node, const std::string& path, int line, std::vector<T>& items) {
    lines_[path] = line;
    if (!node.IsSequence())
      return blame(path, line, "must be a list");
    items.assign(node.size(), T{});
    for (std::size_t i = 0; i < items.size(); ++i)
      read(node[i], join(path, std::to_string(i)), node[i].Mark().line + 1, items[i]);
  }

  void blame(const std::string& path, int line, std::string what) {
    mistakes_.push_back({path, line, std::move(what)});
  }

  /// Maps each line of a problem() to the line of its key in the file, or of the nearest section around it. Skips keys
  /// that could not be read, as they are already reported.
  void blame_problems(const std::optional<std::string>& problems);

  [[nodiscard]] std::vector<Mistake> release_mistakes() {
    std::stable_sort(mistakes_.begin(), mistakes_.end(), [](const auto& a, const auto& b) { return a.line < b.line; });
    return std::move(mistakes_);
  }

 private:
  std::map<std::string, int> lines_;
  std::vector<Mistake> mistakes_;
};

/// Section passed to fields() by the reader.
class SectionReader {
 public:
  SectionReader(Reading& reading, const YAML::Node& node, std::string path, int line)
      : reading_(reading), path_(std::move(path)) {
    if (!node.IsMap() && !node.IsNull()) // null: a section without keys
      reading_.blame(path_, line, "must be a section of keys");
    else
      for (const auto& entry : node)
        add(entry.first, entry.second);
  }

  template <class T> void key(std::string_view name, T& value) {
    known_.push_back(name);
    if (const auto entry = entries_.find(name); entry != entries_.end())
      reading_.read(entry->second.value, join(path_, name), entry->second.line, value);
  }
  template <class T> void key_or(std::string_view name, std::optional<T>& value, std::string_view word_for_none) {
    OptionalWord<T> word{value, word_for_none};
    key(name, word);
  }

  [[nodiscard]] bool has(std::string_view name) const { return entries_.contains(name); }

  void blame_unknown_keys() {
    for (const auto& [name, entry] : entries_) {
      if (std::find(known_.begin(), known_.end(), name) == known_.end())
        reading_.blame(join(path_, name), entry.line, unknown_key(name, known_));
    }
  }

 private:
  struct Entry {
    YAML::Node value;
    int line;
  };

  void add(const YAML::Node& key, const YAML::Node& value) {
    const int line = key.Mark().line + 1;
    if (!key.IsScalar())
      reading_.blame(path_, line, "a key must be a word");
    else if (const auto [entry, is_new] = entries_.try_emplace(key.Scalar(), Entry{value, line}); !is_new)
      reading_.blame(join(path_, key.Scalar()), line,
                     "is repeated, first in line " + std::to_string(entry->second.line));
  }

  Reading& reading_;
  std::string path_;
  std::map<std::string, Entry, std::less<>> entries_;
  std::vector<std::string_view> known_;
};

template <class T> void Reading::read_section(const YAML::Node& node, const std::string& path, int line, T& value) {
  SectionReader section{*this, node, path, line};
  fields(section, value);
  section.blame_unknown_keys();
}

void Reading::blame_problems(const std::optional<std::string>& problems) {
  if (!problems)
    return;
  const std::vector<Mistake> unreadable = mistakes_;
  for (const std::string& problem : split_at(*problems, '\n')) {
    const std::string path = path_of(problem);
    std::string known = path;
    while (!known.empty() && !lines_.contains(known))
      known.resize(known.find('.') == std::string::npos ? 0 : known.rfind('.'));
    const int line = known.empty() ? 1 : lines_.at(known);
    if (!is_blamed(unreadable, path))
      blame(path, line, problem.substr(path.size() + 2));
  }
}

} // namespace

std::vector<Mistake> read_tree(const YAML::Node& tree, Config& config) {
  Reading reading;
  reading.read_section(tree, "", 1, config);
  return reading.release_mistakes();
}

std::vector<Mistake> read_and_check(const YAML::Node& tree, Config& config) {
  Reading reading;
  reading.read_section(tree, "", 1, config);
  reading.blame_problems(config.problem());
  return reading.release_mistakes();
}

} // namespace locus
