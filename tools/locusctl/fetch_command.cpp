// SPDX-License-Identifier: Apache-2.0
#include "locusctl/fetch_command.hpp"

#include <cerrno>
#include <fstream>
#include <system_error>

#include <fmt/format.h>

#include "fetch/fetch.hpp"
#include "locus_replay/failure.hpp"
#include "locusctl/lidar_entry.hpp"

namespace locus::tools {
namespace {

namespace fs = std::filesystem;

/// Replaces the file atomically: concurrent readers get either version in full.
void write_atomically(const fs::path& file, const std::string& text) {
  const fs::path new_file = file.string() + ".new";
  std::error_code error;
  if (!(std::ofstream{new_file, std::ios::binary} << text).flush())
    error = {errno, std::generic_category()};
  else
    fs::rename(new_file, file, error);
  if (!error)
    return;
  std::error_code ignored;
  fs::remove(new_file, ignored);
  throw Failure(ExitStatus::failed, fmt::format("{}: cannot be written ({}); name another file with -o, or be root",
                                                file.string(), error.message()));
}

struct Description {
  std::string summary, keys; ///< for the user; for the configuration
  std::string_view suffix;
};

Description describe(const ouster::Metadata& metadata) {
  return {fmt::format("metadata of an {}, serial number {}, {}x{}", name_of(metadata), metadata.serial_number,
                      metadata.columns_per_frame, metadata.frames_per_s),
          "model: Ouster, metadata: ", ".json"};
}

Description describe(const hesai::Calibration& angles) {
  return {fmt::format("angles of the {} lasers of a Hesai", angles.laser_count), "model: auto, calibration: ", ".csv"};
}

} // namespace

std::string fetch(const std::string& address, fs::path file) {
  const SensorFile fetched = value_or_fail(fetch_sensor_file(address), ExitStatus::failed);
  const Description description = std::visit([](const auto& content) { return describe(content); }, fetched.content);
  if (file.empty())
    file = address + std::string{description.suffix};
  if (file.extension() != description.suffix)
    throw Failure(ExitStatus::wrong_usage,
                  fmt::format("{}: its name must end in {}", file.string(), description.suffix));
  write_atomically(file, fetched.text);
  const std::string path = fs::absolute(file).lexically_normal().string();
  return fmt::format("{}: {}\n\nlidars:\n{}", path, description.summary,
                     lidar_entry("lidar1", description.keys + path));
}

} // namespace locus::tools
