// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/overwriting.hpp"

#include <algorithm>
#include <filesystem>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "kitti/kitti_drive.hpp"
#include "locus_replay/failure.hpp"
#include "locus_replay/recorded_input.hpp"
#include "locus_replay/results.hpp"
#include "sweep_folder/sweep_folder.hpp"

namespace locus::tools {
namespace {

using std::filesystem::path;

/// Lists the folders in which a new file would become part of the recording.
std::vector<path> folders_of(const path& capture, const CaptureFolder& folder) {
  std::error_code ignored;
  if (!std::filesystem::is_directory(capture, ignored))
    return {};
  std::vector<path> folders{capture};
  for (const path& file : folder.lidar)
    folders.push_back(file.parent_path());
  for (const char* const part : {"velodyne_points", "velodyne_points/data", "oxts", "oxts/data"}) {
    if (KittiDrive::is(capture))
      folders.push_back(capture / part);
  }
  if (gives_sweeps(capture)) {
    const std::vector<path> of_sweeps = SweepFolder::folders_of(capture);
    folders.insert(folders.end(), of_sweeps.begin(), of_sweeps.end());
  }
  return folders;
}

void add_files_in(const path& folder, std::vector<path>& files) {
  std::error_code error;
  for (std::filesystem::directory_iterator entry{folder, error}, end; !error && entry != end; entry.increment(error))
    files.push_back(entry->path());
}

std::vector<path> inputs_of(const Arguments& arguments, const CaptureFolder& folder, const Config& config) {
  std::vector<path> inputs{arguments.imu};
  for (const Arguments::OdometryFile& odometry : arguments.odometry)
    inputs.push_back(odometry.file);
  for (std::size_t i = 0, samples = inputs.size(); i < samples; ++i)
    inputs.push_back(path{inputs[i]}.replace_extension(".meta.csv"));
  inputs.insert(inputs.end(), {arguments.config, arguments.ground_truth, arguments.map_truth});
  for (const LidarOptions& lidar : config.lidars)
    inputs.emplace_back(lidar.metadata);
  inputs.insert(inputs.end(), folder.lidar.begin(), folder.lidar.end());
  for (const path& read : folders_of(arguments.capture, folder))
    add_files_in(read, inputs);
  return inputs;
}

/// Returns whether both paths are, or will be, one file.
bool are_one(const path& a, const path& b) {
  std::error_code ignored;
  const auto whole = [&](const path& file) {
    return std::filesystem::weakly_canonical(std::filesystem::absolute(file, ignored), ignored);
  };
  return std::filesystem::equivalent(a, b, ignored) || (!a.empty() && !b.empty() && whole(a) == whole(b));
}

/// Throws if the new file or folder would become part of the recording.
void check_is_apart(const std::string& option, const std::string& kind, const path& output, const Arguments& arguments,
                    const CaptureFolder& folder) {
  std::error_code ignored;
  const path parent = std::filesystem::absolute(output / "", ignored).parent_path().parent_path();
  for (const path& recording : folders_of(arguments.capture, folder)) {
    if (std::filesystem::equivalent(parent, recording, ignored))
      throw Failure(ExitStatus::wrong_usage,
                    fmt::format("{} {}: lies in {}, the recording that is read; choose a {} in another folder", option,
                                output.string(), recording.string(), kind));
  }
}

void check_sweeps(const Arguments& arguments, const CaptureFolder& folder) {
  std::error_code error;
  const path& sweeps = arguments.sweeps;
  if (are_one(sweeps / "", arguments.output / ""))
    throw Failure(ExitStatus::wrong_usage,
                  fmt::format("--sweeps {0}: is the folder of the results; choose a folder in it, --sweeps {0}/sweeps",
                              sweeps.string()));
  if (std::filesystem::exists(sweeps, error) && !std::filesystem::is_empty(sweeps, error) && !error)
    throw Failure(
        ExitStatus::wrong_usage,
        fmt::format("--sweeps {}: exists and is not empty; choose a new folder, or remove this one", sweeps.string()));
  check_is_apart("--sweeps", "folder", sweeps, arguments, folder);
}

void check_file(const std::string& option, const path& file, const Arguments& arguments, const CaptureFolder& folder) {
  for (const char* const name : kResultFiles) {
    if (are_one(file, arguments.output / name))
      throw Failure(ExitStatus::wrong_usage, fmt::format("{} {}: the run writes its {} there; choose another file",
                                                         option, file.string(), name));
  }
  check_is_apart(option, "file", file, arguments, folder);
}

} // namespace

void check_nothing_is_written_over(const Arguments& arguments, const CaptureFolder& folder, const Config& config) {
  struct Output {
    path file;
    std::string choice; ///< command line option
  };
  std::vector<Output> outputs;
  for (const auto& [file, option] : {std::pair{arguments.mcap, "--mcap"}, {arguments.calibrate, "--calibrate"}})
    if (!file.empty())
      outputs.push_back({file, fmt::format("file with {}", option)});
  if (!arguments.mcap.empty() && are_one(arguments.mcap, arguments.calibrate))
    throw Failure(
        ExitStatus::wrong_usage,
        fmt::format("--calibrate {}: is also the file of --mcap; choose another file", arguments.calibrate.string()));
  for (const char* const name : kResultFiles)
    outputs.push_back({arguments.output / name, "folder with -o"});
  std::error_code ignored;
  std::erase_if(outputs, [&](const Output& output) { return !std::filesystem::exists(output.file, ignored); });
  for (const path& input : inputs_of(arguments, folder, config)) {
    for (const auto& [file, choice] : outputs) {
      if (std::filesystem::equivalent(file, input, ignored))
        throw Failure(ExitStatus::wrong_usage,
                      fmt::format("{}: the run would write its own {} there; choose another {}", input.string(),
                                  file.filename().string(), choice));
    }
  }
  if (!arguments.mcap.empty())
    check_file("--mcap", arguments.mcap, arguments, folder);
  if (!arguments.calibrate.empty())
    check_file("--calibrate", arguments.calibrate, arguments, folder);
  if (!arguments.sweeps.empty())
    check_sweeps(arguments, folder);
}

} // namespace locus::tools
