// SPDX-License-Identifier: Apache-2.0
#include "daemon/service/run_mark.hpp"

#include <algorithm>
#include <fstream>
#include <string>
#include <system_error>

#include <fmt/format.h>
#include <linux/magic.h>
#include <sys/vfs.h>

#include "daemon/incidents.hpp"
#include "daemon/service/control.hpp"
#include "drivers/files/capture_folder.hpp"

namespace locus::daemon {

namespace {

using std::filesystem::path;

constexpr std::int64_t kPiecesPerKeptDuration = 6; ///< pieces per kept duration; the excess is up to one piece

path folder_of_socket() { return control_path().parent_path(); }

path mark() { return ring_folder() / "run"; }

bool is_in_memory(const path& folder) {
  struct statfs disk {};
  return statfs(folder.c_str(), &disk) == 0 && disk.f_type == TMPFS_MAGIC;
}

} // namespace

path ring_folder() { return folder_of_socket() / "input-ring"; }

Expected<RecordingBounds, std::string> ring_bounds(std::uint64_t max_bytes, Duration keep) {
  std::error_code error;
  std::filesystem::create_directories(folder_of_socket(), error);
  const auto unusable = [](const std::string& why) {
    return fmt::format(
        "{}: {}, so no input is stored there for incidents; mount a tmpfs of 40 MB or more there, or set "
        "record.folder (or record.keep_s: 0 to store no incidents)",
        folder_of_socket().string(), why);
  };
  if (!is_in_memory(folder_of_socket()))
    return unusable("is not a tmpfs");
  const std::uint64_t share = std::filesystem::space(folder_of_socket(), error).capacity / 4;
  if (error || share < RecordOptions::kLeastBytes)
    return unusable("is too small");
  return RecordingBounds{std::min(max_bytes, share), keep / kPiecesPerKeptDuration, keep};
}

void mark_run(const path& run) {
  static path marked; // accessed by the disk thread only
  if (run == marked)
    return;
  marked = run;
  std::error_code ignored;
  std::filesystem::create_directories(ring_folder(), ignored);
  std::ofstream{mark()} << run.string() << std::flush;
}

std::optional<path> consume_mark() {
  std::string run;
  std::getline(std::ifstream{mark()}, run);
  std::error_code ignored;
  std::filesystem::remove(mark(), ignored);
  return run.empty() ? std::nullopt : std::optional<path>{run};
}

void remove_mark_and_ring() {
  std::error_code ignored;
  for (const path& run : runs_in(ring_folder()))
    std::filesystem::remove_all(run, ignored);
  std::filesystem::remove_all(snapshot_in(ring_folder()), ignored);
  std::filesystem::remove(mark(), ignored);
  std::filesystem::remove(ring_folder(), ignored);
}

} // namespace locus::daemon
