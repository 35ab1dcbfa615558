// SPDX-License-Identifier: Apache-2.0
#include "yaml_tree.hpp"

#include <yaml-cpp/yaml.h>

namespace locus::test {
namespace {

void collect(const YAML::Node& node, const std::string& path, std::map<std::string, std::string>& leaves) {
  const std::string prefix = path.empty() ? "" : path + '.';
  if (node.IsMap()) {
    for (const auto& entry : node)
      collect(entry.second, prefix + entry.first.Scalar(), leaves);
  } else if (node.IsSequence() && node.size() > 0 && node[0].IsMap()) {
    for (std::size_t i = 0; i < node.size(); ++i)
      collect(node[i], prefix + std::to_string(i), leaves);
  } else {
    YAML::Emitter emitter;
    emitter << YAML::Flow << node;
    leaves[path] = emitter.c_str();
  }
}

} // namespace

std::map<std::string, std::string> leaves_of(const std::string& yaml) {
  std::map<std::string, std::string> leaves;
  collect(YAML::Load(yaml), "", leaves);
  return leaves;
}

} // namespace locus::test
