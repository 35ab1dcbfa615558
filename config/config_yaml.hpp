// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "config/config.hpp"
#include "core/base/expected.hpp"

namespace locus {

/// All that is wrong, in the order of the lines: one string "where: key: what and what to do" for each mistake. `where`
/// is file:line, or the --set option at fault.
using ConfigErrors = std::vector<std::string>;

/// Reads a configuration file. Keys it does not name keep their defaults; a key nobody knows is an error. At start-up
/// only.
Expected<Config, ConfigErrors> load_config(const std::filesystem::path& file);

/// As load_config, for a robot to run on: a file that names no lidar, as one that is empty or ends before that, is an
/// error unless it says `defaults: true`.
Expected<Config, ConfigErrors> load_service_config(const std::filesystem::path& file);

/// As load_config, from text; `origin` stands for the file's name in errors.
Expected<Config, ConfigErrors> parse_config(const std::string& yaml, const std::string& origin);

/// Applies options such as "lidars.front.port=2369" all at once: dotted path, list items by name or index, value in
/// YAML.
Expected<Config, ConfigErrors> override_config(const Config& config, std::span<const std::string> assignments);

/// YAML with every key, in full precision: it reads back to the same configuration (angles to 1e-9 deg).
std::string print_config(const Config& config);

/// SHA-256 of print_config() in lower-case hex: names the configuration that a result was made with.
std::string config_sha256(const Config& config);

} // namespace locus
