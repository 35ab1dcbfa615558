// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "faults/fault.hpp"

namespace locus::tools {

/// Command line arguments.
struct PlayArguments {
  std::filesystem::path capture;
  std::string to = "127.0.0.1"; ///< destination address: a host, broadcast or a multicast group
  double speed = 1.0;
  std::optional<std::string> interface; ///< of DDS; nothing: as in the folder's configuration
  std::optional<int> domain;            ///< DDS domain; nothing: likewise
  bool keep_stamps = false;
  bool clock = false;             ///< publishes /clock for nodes with use_sim_time
  std::filesystem::path lockstep; ///< control socket of the service to wait for; empty: none
  bool quiet = false;
  std::vector<Fault> faults;
};

/// Returns nothing if help or version were requested and have been printed. Throws Failure.
std::optional<PlayArguments> parse_play_arguments(int argc, char** argv);

} // namespace locus::tools
