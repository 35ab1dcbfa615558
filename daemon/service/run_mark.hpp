// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "core/base/expected.hpp"
#include "core/base/stamp.hpp"
#include "daemon/recorder.hpp"

/// What survives a crash of the service, in a folder of its own beside the control socket: the input of the last
/// minute, and a mark that tells which run was being recorded. Both are removed at a clean end. For the service alone
/// that owns the control socket.
namespace locus::daemon {

/// Of the recording that is for incidents alone, in memory.
std::filesystem::path ring_folder();

/// A quarter of the file system at most, for others need room there, too. One line for the user where none is to be
/// held: on what is no tmpfs it would wear out a disk, and in less than RecordOptions::kLeastBytes is no sense.
Expected<RecordingBounds, std::string> ring_bounds(std::uint64_t max_bytes, Duration keep);

/// Thread of the disk: says that this run is being recorded; empty: none yet.
void mark_run(const std::filesystem::path& run);

/// The run that another process has marked and not unmarked; once.
std::optional<std::filesystem::path> take_marked_run();

/// Of all processes; what is not named as they name it stays.
void remove_mark_and_ring();

} // namespace locus::daemon
