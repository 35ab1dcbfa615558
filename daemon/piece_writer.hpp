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
#include "daemon/input.hpp"
#include "drivers/files/pcap_writer.hpp"

namespace locus::daemon {

/// The file of a capture folder for the samples of each source, by index; none for a second IMU, which the format does
/// not know.
std::vector<std::optional<std::string>> sample_files(const Config& config);

/// Writes a capture folder: lidar.pcap, config.yaml, and for each source its samples with their arrivals. Every number
/// is read again as it was. One owner, who may be held up by the disk.
class PieceWriter {
 public:
  /// Into an empty folder. Fails with one line for the user.
  static Expected<PieceWriter, std::string> open(const std::filesystem::path& folder, const Config& config);

  void write(const Datagram& datagram) { pcap_.write(datagram); }
  /// False where the format cannot hold the sample: its time is before 1951, or its rotation none.
  bool write(const ImuInput& input);
  bool write(const OdometryInput& input);

  /// Hands all over to the system, or to the disk itself. One line for the user unless all has reached it.
  std::optional<std::string> flush(bool to_disk);

  /// Of all files so far.
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
    TextFile samples, meta; ///< without a path: of a source that is not recorded
  };

  PieceWriter(PcapWriter pcap, const std::filesystem::path& folder, const Config& config);
  bool write(SourceId source, Stamp stamp, Stamp arrival, double covariance_scale, const std::string& line);
  void append(TextFile& file, const std::string& text);

  PcapWriter pcap_;
  TextFile config_;
  std::vector<SourceFiles> sources_; ///< by index; opened with the first sample
  std::uint64_t text_bytes_ = 0;
  std::optional<std::string> problem_; ///< since the piece was begun
};

} // namespace locus::daemon
