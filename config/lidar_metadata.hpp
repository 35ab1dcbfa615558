// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "config/config.hpp"
#include "config/config_yaml.hpp"
#include "core/base/expected.hpp"

namespace locus {

/// Completes the configuration from the metadata of its Ouster lidars: a missing port and the built-in IMU. The IMU
/// becomes the motion source NAME_imu, named after its lidar and mounted with it, with the lowest priority. An existing
/// source of kind imu with this name is used instead and retains its priority and, if set, its mounting; if it has a
/// topic, it is read from there only. Reads the metadata files; start-up only.
Expected<Config, ConfigErrors> with_lidar_metadata(Config config);

} // namespace locus
