// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>

#include "drivers/files/pcap_writer.hpp"
#include "locus_replay/output_file.hpp"
#include "locus_sim/capture_sink.hpp"

namespace locus::sim {

/// Capture folder: lidar.pcap and text files. Creates the folder.
class FolderSink : public CaptureSink {
 public:
  explicit FolderSink(const std::filesystem::path& folder);

  void datagram(const Datagram& datagram) override;
  void text(std::string_view file, Stamp arrival, const std::string& lines) override;
  void close() override;

 private:
  std::filesystem::path folder_;
  PcapWriter pcap_;
  std::map<std::string, tools::OutputFile, std::less<>> files_;
};

} // namespace locus::sim
