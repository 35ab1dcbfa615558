// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

namespace locus::experiments {

/// Processors that this process may run on.
std::vector<int> usable_cpus();

/// Runs a program to its end, both of its outputs into `log`; on `cpus` alone, where given. Nothing if it exits with 0,
/// else why not: its last line, where it has said one. Any thread.
std::optional<std::string> run_program(const std::vector<std::string>& command, const std::filesystem::path& log,
                                       const std::vector<int>& cpus = {});

/// Ends all programs that run; as long as the lock lives, none is started and no run_program() returns. Any thread.
[[nodiscard]] std::unique_lock<std::mutex> end_programs();

} // namespace locus::experiments
