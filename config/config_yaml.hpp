// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "config/config.hpp"
#include "core/base/expected.hpp"

namespace locus {

/// All mistakes in the order of the lines, each a string "where: key: mistake and remedy". `where` is file:line, or the
/// --set option at fault.
using ConfigErrors = std::vector<std::string>;

/// Reads a configuration file. Missing keys have their defaults; an unknown key is an error. At start-up only.
Expected<Config, ConfigErrors> load_config(const std::filesystem::path& file);

/// Reads a configuration file for the service: a file without lidars, such as an empty or truncated one, is an error
/// unless it sets `defaults: true`, and so is one that ends within a line at a multiple of 4096 bytes, as an
/// interrupted write does. Otherwise as load_config().
Expected<Config, ConfigErrors> load_service_config(const std::filesystem::path& file);

/// Reads a configuration from text; `origin` replaces the file name in errors. Otherwise as load_config().
Expected<Config, ConfigErrors> parse_config(const std::string& yaml, const std::string& origin);

/// Returns whether the file itself sets a key, such as "lidars.0.T_base_lidar". Precondition: load_config() accepts it.
bool sets_key(const std::filesystem::path& file, const std::string& path);

/// Applies options such as "lidars.front.port=2369" all at once: dotted path, list items by name or index, value in
/// YAML.
Expected<Config, ConfigErrors> override_config(const Config& config, std::span<const std::string> assignments);

/// Formats every key as YAML in full precision: it reads back to the same configuration (angles to 1e-9 deg).
std::string print_config(const Config& config);

/// Returns a pose as a configuration file states it: its angles are rounded to 1e-9 deg.
Pose as_written(Pose pose);

/// Returns the SHA-256 of print_config() in lower-case hex, to identify the configuration of a result.
std::string config_sha256(const Config& config);

} // namespace locus
