// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "faults/fault.hpp"

namespace locus::tools {

/// What the user asked for.
struct PlayArguments {
  std::filesystem::path capture;
  std::string to = "127.0.0.1"; ///< address, of one host, of all or of a multicast group
  double speed = 1.0;
  std::optional<std::string> interface; ///< of DDS; nothing: that of the folder's configuration
  std::optional<int> domain;            ///< the same
  bool keep_stamps = false;
  bool clock = false;             ///< for nodes with use_sim_time
  std::filesystem::path lockstep; ///< control socket of the service that is waited for; empty: none is
  bool quiet = false;
  std::vector<Fault> faults;
};

/// Nothing where help or version were asked for and have been printed. Throws Failure.
std::optional<PlayArguments> parse_play_arguments(int argc, char** argv);

} // namespace locus::tools
