// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <yaml-cpp/yaml.h>

#include <vector>

#include "config/config.hpp"
#include "config/config_mistakes.hpp"

/// Configuration as a tree of YAML. Internal to config_yaml.hpp. Any thread.
namespace locus {

/// Reads a tree into `config`; fields without a key stay unchanged. Returns the mistakes in the order of their lines.
std::vector<Mistake> read_tree(const YAML::Node& tree, Config& config);

/// Reads a tree as read_tree() does, and checks the result: the mistakes include those of Config::problem().
std::vector<Mistake> read_and_check(const YAML::Node& tree, Config& config);

/// Returns the tree of every key. Takes a copy, since fields() converts in place.
YAML::Node to_tree(Config config);

} // namespace locus
