// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include "core/base/stamp.hpp"
#include "locus_sim/robot.hpp"
#include "locus_sim/world.hpp"

namespace locus::tools {

/// Command line arguments.
struct SimArguments {
  sim::NamedWorld world;
  sim::NamedRobot robot;
  Duration duration;
  std::uint64_t seed = 1;
  sim::SensorChoice sensors;
  std::vector<sim::Slip> slips;
  bool names_vehicle = false;    ///< --vehicle was given, rather than implied by --realism
  std::optional<double> halts_s; ///< longest halt, at every other corner; nothing: the robot's default
  std::filesystem::path output;
};

/// Returns nothing if help or version were requested and have been printed. Throws Failure.
std::optional<SimArguments> parse_sim_arguments(int argc, char** argv);

} // namespace locus::tools
