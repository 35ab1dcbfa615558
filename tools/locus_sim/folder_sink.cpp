// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/folder_sink.hpp"

#include <system_error>

#include "drivers/files/capture_folder.hpp"

namespace locus::sim {
namespace {

std::filesystem::path made(const std::filesystem::path& folder) {
  tools::make_folder(folder);
  std::error_code ignored;
  for (const char* const source : {"imu", "wio", "vio", "kio"}) // leftovers of another robot with other sources
    for (const char* const ending : {".csv", ".tum", ".meta.csv"})
      std::filesystem::remove(folder / (source + std::string(ending)), ignored);
  for (const char* const lidar : {"top", "front", "rear"})
    std::filesystem::remove(folder / metadata_file(lidar), ignored);
  return folder;
}

} // namespace

FolderSink::FolderSink(const std::filesystem::path& folder)
    : folder_(made(folder)),
      pcap_(tools::value_or_fail(PcapWriter::open(folder / "lidar.pcap"), tools::ExitStatus::failed)) {}

void FolderSink::datagram(const Datagram& datagram) { pcap_.write(datagram); }

void FolderSink::text(std::string_view file, Stamp, const std::string& lines) {
  auto open = files_.find(file);
  if (open == files_.end())
    open = files_.emplace(file, folder_ / file).first;
  open->second.print("{}", lines);
}

void FolderSink::close() {
  if (const auto problem = pcap_.flush())
    throw tools::Failure(tools::ExitStatus::failed, *problem);
  for (auto& [name, file] : files_)
    file.close();
}

} // namespace locus::sim
