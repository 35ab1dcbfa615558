// SPDX-License-Identifier: Apache-2.0
#include "drivers/files/capture_folder.hpp"

#include <algorithm>
#include <array>
#include <fstream>
#include <iterator>
#include <optional>
#include <regex>
#include <system_error>
#include <utility>

#include <fmt/format.h>

namespace locus {
namespace {

using std::filesystem::path;

constexpr std::array<const char*, 2> kCaptures{".pcap", ".pcapng"};
constexpr std::array<const char*, 5> kPackings{"", ".gz", ".xz", ".zst", ".zstd"};

/// Removes the extension of the compression from a name.
path unpacked_name(const path& file) {
  const bool is_packed = file.has_extension() && std::ranges::find(kPackings, file.extension()) != kPackings.end();
  return is_packed ? path{file}.replace_extension() : file;
}

/// Finds the file `name`, compressed or not.
std::optional<path> packed_or_not(const path& name) {
  std::error_code ignored;
  for (const char* const packing : kPackings) {
    const path file = name.string() + packing;
    if (std::filesystem::exists(file, ignored)) {
      return file;
    }
  }
  return std::nullopt;
}

/// Lists the file and its continuation parts.
std::vector<path> parts_of(const path& first) {
  std::vector<path> parts{first};
  std::optional<path> next = first;
  for (int number = 1; next && is_named_as_capture(first); ++number) {
    next = packed_or_not(unpacked_name(first).string() + std::to_string(number));
    if (next) {
      parts.push_back(*next);
    }
  }
  return parts;
}

/// Returns folder/name if it exists, otherwise an empty path.
path existing(const path& folder, const char* name) {
  std::error_code ignored;
  return std::filesystem::exists(folder / name, ignored) ? folder / name : path{};
}

/// Returns existing() as a list.
std::vector<path> all_existing(const path& folder, const char* name) {
  const path file = existing(folder, name);
  return file.empty() ? std::vector<path>{} : std::vector<path>{file};
}

std::vector<CaptureFolder::Source> odometry_in(const std::vector<path>& files) {
  std::vector<CaptureFolder::Source> sources;
  for (const path& file : files) {
    if (file.extension() == ".tum" && file.filename() != "gt.tum") {
      sources.push_back({file.stem().string(), {file}});
    }
  }
  return sources;
}

/// Finds a NAME.meta.csv without its source, which would otherwise be ignored silently.
std::optional<std::string> stray_meta_in(const std::vector<path>& files) {
  for (const path& file : files) {
    const path source = path{file}.replace_extension().replace_extension(); // removes .meta.csv
    const bool stray = file.string().ends_with(".meta.csv") && !std::filesystem::exists(source.string() + ".tum") &&
                       !std::filesystem::exists(source.string() + ".csv");
    if (stray) {
      return fmt::format("{}: belongs to no source; expected {}.tum or {}.csv beside it", file.string(),
                         source.filename().string(), source.filename().string());
    }
  }
  return std::nullopt;
}

Expected<std::vector<path>, std::string> entries_of(const path& where) {
  std::error_code error;
  std::vector<path> files;
  for (std::filesystem::directory_iterator entry{where, error}, end; !error && entry != end; entry.increment(error)) {
    files.push_back(entry->path());
  }
  if (error) {
    return fmt::format("{}: {}; check its permissions", where.string(), error.message());
  }
  std::ranges::sort(files); // directory order is unspecified
  return files;
}

Expected<CaptureFolder, std::string> folder_of(const path& where) {
  const Expected<std::vector<path>, std::string> files = entries_of(where);
  if (!files) {
    return files.error();
  }
  const std::vector<path> captures = captures_in(where);
  if (captures.size() > 1) {
    return fmt::format("{}: holds both {} and {}; remove or rename one", where.string(),
                       captures[0].filename().string(), captures[1].filename().string());
  }
  CaptureFolder found;
  found.lidar = parts_of(captures.front());
  found.imu = all_existing(where, "imu.csv");
  found.ground_truth = existing(where, "gt.tum");
  found.map_truth = existing(where, "gt_map.ply");
  found.config = all_existing(where, "config.yaml");
  found.odometry = odometry_in(*files);
  if (std::optional<std::string> problem = stray_meta_in(*files)) {
    return *std::move(problem);
  }
  return found;
}

/// Appends a piece to the recording. Ground truth, which only one piece contains, is taken from the last piece.
void append(CaptureFolder& recording, CaptureFolder piece) {
  recording.ground_truth = std::move(piece.ground_truth);
  recording.map_truth = std::move(piece.map_truth);
  std::ranges::move(piece.lidar, std::back_inserter(recording.lidar));
  std::ranges::move(piece.imu, std::back_inserter(recording.imu));
  std::ranges::move(piece.config, std::back_inserter(recording.config));
  for (CaptureFolder::Source& source : piece.odometry) {
    const auto known = std::ranges::find(recording.odometry, source.name, &CaptureFolder::Source::name);
    if (known == recording.odometry.end()) {
      recording.odometry.push_back(std::move(source));
    } else {
      std::ranges::move(source.files, std::back_inserter(known->files));
    }
  }
}

std::string text_of(const path& file) {
  std::ifstream stream{file, std::ios::binary};
  return {std::istreambuf_iterator<char>{stream}, {}};
}

bool has_capture(const path& where) { return !captures_in(where).empty(); }

/// Lists the capture folders: `where` itself or those in it.
std::vector<path> capture_folders_in(const path& where) {
  if (has_capture(where)) {
    return {where};
  }
  std::vector<path> folders = pieces_in(where);
  for (const path& run : runs_in(where)) {
    std::ranges::move(pieces_in(run), std::back_inserter(folders));
  }
  std::erase_if(folders, [](const path& piece) { return !has_capture(piece); }); // piece was just started
  return folders;
}

std::vector<path> folders_named(const path& where, const std::regex& name) {
  std::vector<path> found;
  const Expected<std::vector<path>, std::string> files = entries_of(where);
  for (const path& file : files ? *files : std::vector<path>{}) {
    std::error_code ignored;
    if (std::regex_match(file.filename().string(), name) && std::filesystem::is_directory(file, ignored)) {
      found.push_back(file);
    }
  }
  std::ranges::stable_sort(found, {}, &number_of);
  return found;
}

} // namespace

bool is_named_as_capture(const path& file) {
  return std::ranges::find(kCaptures, unpacked_name(file).extension()) != kCaptures.end();
}

std::vector<path> captures_in(const path& folder) {
  std::vector<path> found;
  for (const char* const capture : kCaptures) {
    for (const char* const packing : kPackings) {
      if (path file = existing(folder, fmt::format("lidar{}{}", capture, packing).c_str()); !file.empty()) {
        found.push_back(std::move(file));
      }
    }
  }
  return found;
}

std::string metadata_file(const std::string& lidar) { return lidar + ".json"; }

std::vector<path> runs_in(const path& folder) {
  static const std::regex kRun{R"(\d{6,9}_\d{4}-\d\d-\d\dT\d\d-\d\d-\d\dZ)"};
  return folders_named(folder, kRun);
}

std::vector<path> pieces_in(const path& run) {
  static const std::regex kPiece{R"(\d{6,9})"};
  return folders_named(run, kPiece);
}

int number_of(const path& folder) { return std::stoi(folder.filename().string()); }

Expected<CaptureFolder, std::string> CaptureFolder::find(const path& where) {
  std::error_code error;
  if (where != "-" && !std::filesystem::exists(where, error)) {
    return fmt::format("{}: no such file or folder; check the path", where.string());
  }
  if (where == "-" || !std::filesystem::is_directory(where, error)) {
    CaptureFolder found;
    found.lidar = parts_of(where);
    return found;
  }
  if (const auto files = entries_of(where); !files) {
    return files.error();
  }
  CaptureFolder recording;
  for (const path& folder : capture_folders_in(where)) {
    Expected<CaptureFolder, std::string> piece = folder_of(folder);
    if (!piece) {
      return piece;
    }
    append(recording, std::move(*piece));
  }
  if (recording.lidar.empty()) {
    return fmt::format("{}: holds no lidar.pcap or lidar.pcapng; rename the capture or name it instead of the folder",
                       where.string());
  }
  return recording;
}

path CaptureFolder::first_config() const { return config.empty() ? path{} : config.front(); }

std::optional<std::string> CaptureFolder::changed_config() const {
  if (config.empty()) {
    return std::nullopt;
  }
  const std::string first = text_of(config.front());
  const auto other = std::ranges::find_if(config, [&](const path& file) { return text_of(file) != first; });
  if (other == config.end()) {
    return std::nullopt;
  }
  return fmt::format("{}: differs from {}, which is used for all; name the folder that is meant", other->string(),
                     config.front().string());
}

} // namespace locus
