// SPDX-License-Identifier: Apache-2.0
#include "sweep_folder/sweep_folder.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <iterator>
#include <string_view>
#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "kitti/kitti_sweep.hpp"
#include "sweep_folder/folder_truth.hpp"
#include "sweep_folder/sweep_times.hpp"

namespace locus::tools {
namespace {

using std::filesystem::path;
using Problem = std::optional<std::string>;

constexpr std::array<const char*, 3> kTables{"data.csv", "times.txt", "timestamps.txt"};

bool is_folder(const path& where) {
  std::error_code ignored;
  return std::filesystem::is_directory(where, ignored);
}

bool is_file(const path& where) {
  std::error_code ignored;
  return std::filesystem::is_regular_file(where, ignored);
}

bool is_named_as_sweep(const path& file) {
  const std::string name = file.filename().string();
  return std::isdigit(static_cast<unsigned char>(name.front())) != 0 &&
         (file.extension() == ".pcd" || file.extension() == ".bin");
}

/// Sorts numerically, 2 before 10, with or without zero padding.
bool comes_before(const path& a, const path& b) {
  const auto key = [](const path& file) {
    std::string name = file.stem().string();
    name.erase(0, std::min(name.find_first_not_of('0'), name.size()));
    return std::pair{std::min(name.find_first_not_of("0123456789"), name.size()), name};
  };
  return key(a) < key(b);
}

std::vector<path> sweeps_in(const path& folder) {
  std::vector<path> files;
  std::error_code error;
  for (std::filesystem::directory_iterator entry{folder, error}, end; !error && entry != end; entry.increment(error)) {
    if (is_named_as_sweep(entry->path()) && is_file(entry->path()))
      files.push_back(entry->path());
  }
  std::ranges::sort(files, comes_before);
  return files;
}

bool has_sweep(const path& folder) {
  std::error_code error;
  for (std::filesystem::directory_iterator entry{folder, error}, end; !error && entry != end; entry.increment(error)) {
    if (is_named_as_sweep(entry->path()))
      return true;
  }
  return false;
}

/// Returns whether a folder has sweeps, or nothing at all: one with other files, such as captures, is no recording.
bool may_have_sweeps(const path& folder) {
  std::error_code error;
  return is_folder(folder) && (has_sweep(folder) || std::filesystem::is_empty(folder, error));
}

/// Returns the folder of the sweeps; empty if there is none.
path sweeps_folder_of(const path& where) {
  for (const char* const name : {"velodyne", "lidar0/data", "lidar0"}) {
    if (may_have_sweeps(where / name))
      return where / name;
  }
  for (const path& folder : {where, where / "data"}) {
    if (has_sweep(folder))
      return folder;
  }
  return {};
}

/// Searches the recording, and next to it if it consists of the sweeps only.
std::optional<path> found_near(const path& where, const char* name) {
  const path whole = std::filesystem::absolute(where / "").lexically_normal().parent_path();
  const path sweeps = sweeps_folder_of(where);
  const bool are_alone = sweeps == where || sweeps == where / "data";
  for (const path& folder : {whole, are_alone ? whole.parent_path() : whole}) {
    if (is_file(folder / name))
      return folder / name;
  }
  return std::nullopt;
}

/// Returns the first table of times next to the sweeps, above their folder or in the recording.
std::optional<path> table_of(const path& where, const path& sweeps) {
  for (const path& folder :
       {sweeps, std::filesystem::absolute(sweeps / "").lexically_normal().parent_path().parent_path(), where}) {
    for (const char* const name : kTables) {
      if (is_file(folder / name))
        return folder / name;
    }
  }
  return std::nullopt;
}

/// Interprets all names as times: seconds have had ten digits since 2001.
Expected<std::vector<TimeText>, std::string> times_in_names(const std::vector<path>& files) {
  constexpr std::size_t kDigitsOfSeconds = 10;
  std::vector<TimeText> times;
  for (const path& file : files) {
    const std::string name = file.stem().string();
    const std::size_t digits = std::min(name.find_first_not_of("0123456789"), name.size());
    if (digits < kDigitsOfSeconds || name.starts_with('0')) // ten digits counting from 0 are KITTI's raw data
      return fmt::format(
          "{}: neither are the names of its sweeps times ({}), nor is there times.txt, timestamps.txt or "
          "data.csv; add one with a line for each sweep",
          file.parent_path().string(), file.filename().string());
    times.push_back({name, "", file.string()});
  }
  return times;
}

/// Replaces the files of rows that name one; keeps the order otherwise.
Problem match(const std::vector<TimeText>& times, const path& table, const path& folder, std::vector<path>& files) {
  if (times.size() != files.size())
    return fmt::format("{}: {} times for {} sweeps in {}; there must be one for each, copy the recording again",
                       table.string(), times.size(), files.size(), folder.string());
  for (std::size_t i = 0; i < times.size(); ++i) {
    if (times[i].sweep.empty())
      continue;
    files[i] = folder / path{times[i].sweep}.filename();
    if (!is_file(files[i]))
      return fmt::format("{}: there is no {}; copy the recording again", times[i].place, files[i].string());
  }
  return std::nullopt;
}

Problem read_sweeps(const path& where, SweepFolder& recording) {
  std::vector<path> files = sweeps_in(recording.folder);
  if (files.empty())
    return fmt::format("{}: contains no sweep, a .pcd or .bin whose name begins with a digit; copy the recording again",
                       recording.folder.string());
  const std::optional<path> table = table_of(where, recording.folder);
  const auto times = table ? read_times(*table) : times_in_names(files);
  if (!times)
    return times.error();
  if (Problem problem = table ? match(*times, *table, recording.folder, files) : std::nullopt)
    return problem;
  const auto stamps = stamps_of(*times);
  if (!stamps)
    return stamps.error();
  for (std::size_t i = 0; i < files.size(); ++i)
    recording.sweeps.push_back({files[i], (*stamps)[i]});
  recording.step = usual_step(*stamps);
  return std::nullopt;
}

Problem read_truth(const path& where, SweepFolder& recording) {
  std::vector<Stamp> stamps;
  std::ranges::transform(recording.sweeps, std::back_inserter(stamps), &SweepFolder::Sweep::stamp);
  const std::optional<path> euroc = found_near(where, "state_groundtruth_estimate0/data.csv");
  Expected<std::vector<StampedPose>, std::string> truth = std::vector<StampedPose>{};
  if (recording.is_kitti)
    truth = read_kitti_truth(where, stamps);
  else if (euroc)
    truth = read_euroc_truth(*euroc);
  if (!truth)
    return truth.error();
  recording.truth = *std::move(truth);
  return std::nullopt;
}

} // namespace

bool SweepFolder::is(const path& where) { return is_folder(where) && !sweeps_folder_of(where).empty(); }

bool SweepFolder::is_kitti_odometry(const path& where) {
  return is_folder(where / "velodyne") && is_file(where / "calib.txt");
}

bool SweepFolder::is_of_hdl64(const path& where) {
  constexpr std::size_t kManyRings = 50, kLook = 5;
  std::vector<KittiPoint> points;
  std::vector<KittiReturn> returns;
  const std::vector<path> files = sweeps_in(sweeps_folder_of(where));
  for (std::size_t i = 0; i < std::min(files.size(), kLook); ++i) {
    if (read_kitti_points(files[i], points))
      return find_returns(points, returns).value_or(0) >= kManyRings;
  }
  return false;
}

std::optional<path> SweepFolder::imu_of(const path& where) { return found_near(where, "imu0/data.csv"); }

std::vector<path> SweepFolder::folders_of(const path& where) {
  std::vector<path> folders{where, sweeps_folder_of(where)};
  folders.push_back(folders.back().parent_path());
  if (const auto imu = imu_of(where))
    folders.push_back(imu->parent_path());
  return folders;
}

Expected<SweepFolder, std::string> SweepFolder::open(const path& where) {
  SweepFolder recording;
  recording.folder = sweeps_folder_of(where);
  recording.is_kitti = is_kitti_odometry(where);
  if (Problem problem = read_sweeps(where, recording))
    return *std::move(problem);
  recording.is_hdl64 = recording.is_kitti && is_of_hdl64(where);
  if (Problem problem = read_truth(where, recording))
    return *std::move(problem);
  return recording;
}

std::optional<std::string> SweepFolder::read(const Sweep& sweep, double raised_deg, SweepPoints& points) const {
  if (sweep.file.extension() == ".pcd")
    return read_pcd_points(sweep.file, points);
  return is_hdl64 ? read_kitti_sweep(sweep.file, raised_deg, points) : read_bin_points(sweep.file, points);
}

} // namespace locus::tools
