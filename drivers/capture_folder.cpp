// SPDX-License-Identifier: Apache-2.0
#include "drivers/capture_folder.hpp"

#include <algorithm>
#include <optional>
#include <system_error>
#include <utility>

#include <fmt/format.h>

namespace locus {
namespace {

using std::filesystem::path;

/// folder/name, or empty where there is no such file.
path existing(const path& folder, const char* name) {
  std::error_code ignored;
  return std::filesystem::exists(folder / name, ignored) ? folder / name : path{};
}

std::vector<CaptureFolder::Source> odometry_in(const std::vector<path>& files) {
  std::vector<CaptureFolder::Source> sources;
  for (const path& file : files) {
    if (file.extension() == ".tum" && file.filename() != "gt.tum") {
      sources.push_back({file.stem().string(), file});
    }
  }
  return sources;
}

/// A NAME.meta.csv without its source would be ignored in silence.
std::optional<std::string> stray_meta_in(const std::vector<path>& files) {
  for (const path& file : files) {
    const path source = path{file}.replace_extension().replace_extension(); // without .meta.csv
    const bool stray = file.string().ends_with(".meta.csv") && !std::filesystem::exists(source.string() + ".tum") &&
                       !std::filesystem::exists(source.string() + ".csv");
    if (stray) {
      return fmt::format("{}: belongs to no source; expected {}.tum or {}.csv beside it", file.string(),
                         source.filename().string(), source.filename().string());
    }
  }
  return std::nullopt;
}

} // namespace

Expected<CaptureFolder, std::string> CaptureFolder::find(const path& where) {
  CaptureFolder found;
  std::error_code error;
  if (!std::filesystem::exists(where, error)) {
    return fmt::format("{}: no such file or folder; check the path", where.string());
  }
  if (!std::filesystem::is_directory(where, error)) {
    found.lidar = where;
    return found;
  }
  std::vector<path> files;
  for (std::filesystem::directory_iterator entry{where, error}, end; !error && entry != end; entry.increment(error)) {
    files.push_back(entry->path());
  }
  if (error) {
    return fmt::format("{}: {}; check its permissions", where.string(), error.message());
  }
  std::ranges::sort(files); // folders list in any order
  const path pcap = existing(where, "lidar.pcap");
  const path pcapng = existing(where, "lidar.pcapng");
  if (pcap.empty() && pcapng.empty()) {
    return fmt::format("{}: holds no lidar.pcap or lidar.pcapng; rename the capture or name it instead of the folder",
                       where.string());
  }
  if (!pcap.empty() && !pcapng.empty()) {
    return fmt::format("{}: holds both lidar.pcap and lidar.pcapng; remove or rename one", where.string());
  }
  found.lidar = pcap.empty() ? pcapng : pcap;
  found.imu = existing(where, "imu.csv");
  found.ground_truth = existing(where, "gt.tum");
  found.map_truth = existing(where, "gt_map.ply");
  found.config = existing(where, "config.yaml");
  found.odometry = odometry_in(files);
  if (std::optional<std::string> problem = stray_meta_in(files)) {
    return *std::move(problem);
  }
  return found;
}

} // namespace locus
