// SPDX-License-Identifier: Apache-2.0
#include <yaml-cpp/yaml.h>

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "config/config_fields.hpp"
#include "config/config_tree.hpp"
#include "config/config_yaml.hpp"
#include "config/sha256.hpp"
#include "config/yaml_values.hpp"

namespace locus {
namespace {

/// Section passed to fields() by the writer.
class SectionWriter {
 public:
  template <class T> void key(std::string_view name, T& value) { node_.force_insert(std::string{name}, write(value)); }
  template <class T> void key_or(std::string_view name, std::optional<T>& value, std::string_view word_for_none) {
    OptionalWord<T> word{value, word_for_none};
    key(name, word);
  }
  [[nodiscard]] static bool has(std::string_view /*name*/) { return true; }
  [[nodiscard]] YAML::Node node() const { return node_; }

  template <class T> static YAML::Node write(T& value) {
    if constexpr (!HasFields<T>) {
      return to_node(value);
    } else {
      SectionWriter section;
      fields(section, value);
      section.node_.SetStyle(YAML::EmitterStyle::Flow);
      return section.node_;
    }
  }
  template <class T> static YAML::Node write(std::vector<T>& items) {
    YAML::Node node{YAML::NodeType::Sequence};
    for (T& item : items)
      node.push_back(write(item));
    if (!HasFields<T> || items.empty())
      node.SetStyle(YAML::EmitterStyle::Flow);
    return node;
  }

 private:
  YAML::Node node_{YAML::NodeType::Map};
};

} // namespace

YAML::Node to_tree(Config config) {
  SectionWriter section;
  fields(section, config);
  return section.node();
}

std::string print_config(const Config& config) {
  YAML::Emitter emitter;
  emitter << to_tree(config);
  return std::string{emitter.c_str(), emitter.size()} + '\n';
}

Pose as_written(Pose pose) {
  SectionWriter unused;
  fields(unused, pose);
  return pose;
}

std::string config_sha256(const Config& config) {
  const std::string text = print_config(config);
  Sha256 digest;
  digest.add(std::as_bytes(std::span(text)));
  return digest.hex();
}

} // namespace locus
