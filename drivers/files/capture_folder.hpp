// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/base/expected.hpp"

namespace locus {

/// Files of a recording, identified by fixed names.
///
/// A recording may consist of pieces, as locusd writes them; each piece is a capture folder. All pieces of a run, or of
/// several runs, form one recording in numerical order.
struct CaptureFolder {
  struct Source {
    std::string name;
    std::vector<std::filesystem::path> files;
  };

  std::vector<std::filesystem::path> lidar;  ///< captures_in() each piece, with their parts; at least one
  std::vector<std::filesystem::path> imu;    ///< imu.csv; this and the next three are empty if absent
  std::filesystem::path ground_truth;        ///< gt.tum
  std::filesystem::path map_truth;           ///< gt_map.ply
  std::vector<std::filesystem::path> config; ///< config.yaml
  std::vector<Source> odometry;              ///< every other *.tum, by name

  /// Finds the files by name alone, without opening any. A file is the capture itself, with the continuation parts of
  /// tcpdump -C: x.pcap, x.pcap1, x.pcap2; "-" is standard input. Fails with one line for the user.
  static Expected<CaptureFolder, std::string> find(const std::filesystem::path& where);

  /// Returns the configuration of the first piece; empty if there is none.
  [[nodiscard]] std::filesystem::path first_config() const;

  /// Compares the configurations. Returns one line for the user if a later piece was recorded with a different one.
  [[nodiscard]] std::optional<std::string> changed_config() const;
};

/// Returns true if the file is named like a capture: .pcap or .pcapng, optionally followed by .gz, .xz, .zst or .zstd.
bool is_named_as_capture(const std::filesystem::path& file);

/// Lists the captures named "lidar" in `folder`; more than one is a contradiction.
std::vector<std::filesystem::path> captures_in(const std::filesystem::path& folder);

/// Returns the name of an Ouster's metadata file, derived from the name of the lidar.
std::string metadata_file(const std::string& lidar);

/// Lists the folders named like runs, by number and time (000003_2026-11-22T08-12-05Z), and the folders in a run named
/// like pieces, by number (000007); in numerical order.
std::vector<std::filesystem::path> runs_in(const std::filesystem::path& folder);
std::vector<std::filesystem::path> pieces_in(const std::filesystem::path& run);

/// Returns the number of a run or a piece.
int number_of(const std::filesystem::path& folder);

} // namespace locus
