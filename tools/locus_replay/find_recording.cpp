// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/find_recording.hpp"

#include <algorithm>
#include <cstddef>
#include <system_error>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <unistd.h>

#include "bags/bag.hpp"
#include "kitti/kitti_drive.hpp"
#include "locus_replay/failure.hpp"
#include "sweep_folder/sweep_folder.hpp"

namespace locus::tools {
namespace {

bool is_all_in_one(const std::filesystem::path& where) {
  return looks_like_bag(where) || KittiDrive::is(where) || SweepFolder::is(where);
}

/// Returns whether the file is a recording by itself, judged by its name. A folder of ROS 2 bags is one as a whole.
bool is_recording_file(const std::filesystem::path& file) {
  return file.extension() == ".bag" || is_named_as_capture(file);
}

/// Lists what could be replayed in a folder that is not a recording itself, or in its subfolders.
std::vector<std::filesystem::path> recordings_in(const std::filesystem::path& where) {
  constexpr int kDepth = 2;
  std::vector<std::filesystem::path> found;
  std::error_code ignored;
  using std::filesystem::directory_options;
  std::filesystem::recursive_directory_iterator entry{where, directory_options::skip_permission_denied, ignored};
  for (const std::filesystem::recursive_directory_iterator end; !ignored && entry != end; entry.increment(ignored)) {
    const bool is_folder = entry->is_directory(ignored);
    const bool is_recording = is_folder ? is_all_in_one(entry->path()) || CaptureFolder::find(entry->path())
                                        : is_recording_file(entry->path());
    if (is_recording)
      found.push_back(entry->path());
    if (is_recording || entry.depth() + 1 >= kDepth)
      entry.disable_recursion_pending();
  }
  std::ranges::sort(found);
  return found;
}

std::string names_of_some(const std::vector<std::filesystem::path>& recordings) {
  constexpr std::size_t kNamed = 3;
  std::string names;
  for (std::size_t i = 0; i < std::min(kNamed, recordings.size()); ++i)
    names += fmt::format("{}{}", i > 0 ? ", " : "", recordings[i].string());
  return recordings.size() > kNamed ? fmt::format("{} and {} more", names, recordings.size() - kNamed) : names;
}

/// Returns nothing if it is not a recording.
std::optional<CaptureFolder> files_of(const std::filesystem::path& capture) {
  if (Expected<CaptureFolder, std::string> folder = CaptureFolder::find(capture))
    return *std::move(folder);
  if (!is_all_in_one(capture))
    return std::nullopt;
  CaptureFolder all;
  all.lidar = {capture};
  if (const auto imu = KittiDrive::is(capture) ? std::nullopt : SweepFolder::imu_of(capture))
    all.imu = {*imu};
  return all;
}

} // namespace

FoundRecording find_recording(const std::filesystem::path& named) {
  if (named == "-" && isatty(STDIN_FILENO) == 1)
    throw Failure(ExitStatus::wrong_usage,
                  "-: standard input is a terminal; try: tcpdump -s 0 -w - udp | locus-replay -o out -");
  if (const std::filesystem::path folder = named.has_parent_path() ? named.parent_path() : ".";
      named.filename() == "metadata.yaml" && looks_like_bag(folder))
    throw Failure(ExitStatus::failed,
                  fmt::format("{}: describes a bag; name its folder instead: {}", named.string(), folder.string()));
  if (std::optional<CaptureFolder> files = files_of(named))
    return {named, *std::move(files), ""};
  const auto inside = captures_in(named).empty() ? recordings_in(named) : std::vector<std::filesystem::path>{};
  if (inside.size() > 1)
    throw Failure(ExitStatus::failed,
                  fmt::format("{}: contains {} recordings, but is not one itself; name one of them: {}", named.string(),
                              inside.size(), names_of_some(inside)));
  if (inside.empty())
    return {named, value_or_fail(CaptureFolder::find(named), ExitStatus::failed), ""};
  return {inside.front(), files_of(inside.front()).value(),
          fmt::format("{}: the only recording in it is used, {}", named.string(), inside.front().string())};
}

void check_output(const std::filesystem::path& folder) {
  if (std::filesystem::is_directory(folder) && files_of(folder))
    throw Failure(ExitStatus::wrong_usage,
                  fmt::format("-o {}: contains a recording; choose another folder for the results", folder.string()));
}

} // namespace locus::tools
