// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "config/config.hpp"

namespace locus::daemon {

/// Gives the process what RealtimeOptions ask of the operating system; to be called before the threads are made, for
/// they inherit processors. Nothing is needed for the service to work: a line for the user for each wish that was not
/// granted. Without a wish, what an earlier call has done is undone.
std::optional<std::string> lock_memory(bool wanted);
std::optional<std::string> keep_to_cpus(const std::vector<int>& cpus);

/// Of the calling thread, and of those that it will make: TBB's helpers have the priority of the thread they help.
std::optional<std::string> raise_priority(int fifo_priority);

} // namespace locus::daemon
