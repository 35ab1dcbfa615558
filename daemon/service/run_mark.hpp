// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "core/base/expected.hpp"
#include "core/base/stamp.hpp"
#include "daemon/capture_ring.hpp"

/// Data that survives a crash of the service, in a folder next to the control socket: the input of the last minute, and
/// a mark with the run being recorded. Both are removed at a clean end. Only for the service that owns the control
/// socket.
namespace locus::daemon {

/// Returns the folder of the in-memory recording for incidents.
std::filesystem::path ring_folder();

/// Returns the limits of that recording, a quarter of the file system at most, which is shared with other programs.
/// Fails with one line for the user if the folder is not on a tmpfs, since writes would wear out a disk, or is smaller
/// than RecordOptions::kLeastBytes.
Expected<RecordingBounds, std::string> ring_bounds(std::uint64_t max_bytes, Duration keep);

/// Disk thread: marks this run as being recorded; empty: none yet.
void mark_run(const std::filesystem::path& run);

/// Returns the run marked by a process that did not end cleanly, and removes the mark.
std::optional<std::filesystem::path> consume_mark();

/// Removes the mark and the recordings of all processes; files with other names stay.
void remove_mark_and_ring();

} // namespace locus::daemon
