// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/base/expected.hpp"

namespace locus {

/// The files of a recording, by their fixed names.
///
/// A recording may come in pieces, as locusd makes them: each is a capture folder. All pieces of a run, or of several
/// runs, are one recording in the order of their numbers.
struct CaptureFolder {
  struct Source {
    std::string name;
    std::vector<std::filesystem::path> files;
  };

  std::vector<std::filesystem::path> lidar;  ///< captures_in() each piece, with their parts; at least one
  std::vector<std::filesystem::path> imu;    ///< imu.csv; this and the next three are empty where the folder has none
  std::filesystem::path ground_truth;        ///< gt.tum
  std::filesystem::path map_truth;           ///< gt_map.ply
  std::vector<std::filesystem::path> config; ///< config.yaml
  std::vector<Source> odometry;              ///< every other *.tum, by name

  /// Looks at names alone and opens nothing. A file is taken for the capture itself, with the parts that follow it as
  /// tcpdump -C names them: x.pcap, x.pcap1, x.pcap2; "-" is standard input. Fails with one line for the user.
  static Expected<CaptureFolder, std::string> find(const std::filesystem::path& where);

  /// The configuration that the recording was made with, that of its first piece; empty if it has none.
  [[nodiscard]] std::filesystem::path first_config() const;

  /// Reads them: one line for the user if a later piece was recorded with another configuration than the first.
  [[nodiscard]] std::optional<std::string> changed_config() const;
};

/// Whether the file is named as captures are: .pcap or .pcapng, and .gz, .xz, .zst or .zstd behind it where it is
/// packed.
bool is_named_as_capture(const std::filesystem::path& file);

/// The files in `folder` that are named as captures are, and lidar before that; more than one contradict each other.
std::vector<std::filesystem::path> captures_in(const std::filesystem::path& folder);

/// That of an Ouster's metadata, by the name of the lidar.
std::string metadata_file(const std::string& lidar);

/// The folders in `folder` that are named as runs are, by number and time (000003_2026-11-22T08-12-05Z), and those in a
/// run that are named as pieces are, by number (000007); in the order of their numbers.
std::vector<std::filesystem::path> runs_in(const std::filesystem::path& folder);
std::vector<std::filesystem::path> pieces_in(const std::filesystem::path& run);

/// That of a run or a piece.
int number_of(const std::filesystem::path& folder);

} // namespace locus
