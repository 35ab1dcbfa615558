// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "config/config.hpp"
#include "core/base/expected.hpp"
#include "core/base/stamp.hpp"
#include "daemon/input.hpp"
#include "drivers/files/pcap_writer.hpp"

namespace locus::daemon {

/// Returns the name of the sample file of each source in a capture folder, by index; empty for a second IMU, which the
/// format does not support, and for other sources that are not recorded.
std::vector<std::optional<std::string>> sample_files(const Config& config);

/// Writes a capture folder: lidar.pcap, config.yaml, and the samples of each source with their arrivals. Numbers
/// round-trip exactly. One owner; calls may block on the disk.
class PieceWriter {
 public:
  /// Opens the files in an empty folder. Fails with one line for the user.
  static Expected<PieceWriter, std::string> open(const std::filesystem::path& folder, const Config& config);

  void write(const Datagram& datagram) { pcap_.write(datagram); }
  /// Writes a sample; false if the format cannot hold it: a time before 1951, or a zero quaternion.
  bool write(const ImuInput& input);
  bool write(const OdometryInput& input);

  /// Flushes all files to the system, or to the disk. Returns one line for the user on failure.
  std::optional<std::string> flush(bool to_disk);

  /// Returns the size of all files so far.
  [[nodiscard]] std::uint64_t bytes() const { return pcap_.bytes() + text_bytes_; }

 private:
  struct Closer {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };
  struct TextFile {
    std::filesystem::path path;
    std::unique_ptr<std::FILE, Closer> file{};
  };
  struct SourceFiles {
    TextFile samples, meta; ///< empty path: source is not recorded
  };

  PieceWriter(PcapWriter pcap, const std::filesystem::path& folder, const Config& config);
  bool write(SourceId source, Stamp stamp, Stamp arrival, double covariance_scale, const std::string& line);
  void append(TextFile& file, const std::string& text);

  PcapWriter pcap_;
  TextFile config_;
  std::vector<SourceFiles> sources_; ///< by source index; opened with the first sample
  std::uint64_t text_bytes_ = 0;
  std::optional<std::string> problem_; ///< first failure of this piece
};

} // namespace locus::daemon
