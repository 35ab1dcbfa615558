// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "config/config.hpp"
#include "config/config_yaml.hpp"
#include "core/base/expected.hpp"

namespace locus {

/// Completes the configuration by what the metadata of its Ouster lidars tells: the port of one that has none, and the
/// inertial unit that it brings along. That becomes a motion source: the last one in priority, named NAME_imu after its
/// lidar and mounted with it. A source of kind imu that has this name already is taken for it, and keeps its place and,
/// if it has one, its mounting; one with a topic is heard there alone. Reads the metadata; start-up only.
Expected<Config, ConfigErrors> with_lidar_metadata(Config config);

} // namespace locus
