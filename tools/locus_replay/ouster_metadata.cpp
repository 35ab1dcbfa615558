// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/ouster_metadata.hpp"

#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "drivers/files/capture.hpp"
#include "drivers/other_maker.hpp"
#include "drivers/ouster/decoder.hpp"

namespace locus::tools {
namespace {

using std::filesystem::path;

constexpr int kLookedAt = 2000;         ///< datagrams at the start of the capture; three seconds of an Ouster's
constexpr std::size_t kMostFiles = 100; ///< a folder with more is not one to search for metadata
constexpr std::uintmax_t kMostBytes = 1'000'000;

/// File that may be the metadata of the sensor.
struct Candidate {
  path file;
  bool is_named; ///< named after the capture
  std::optional<ouster::Decoder> decoder{};
  std::string problem{};               ///< reason not to use it
  std::optional<std::uint16_t> port{}; ///< destination of packets that match it
};

std::vector<Candidate> candidates_beside(const path& capture) {
  std::vector<Candidate> candidates;
  const path folder = capture.has_parent_path() ? capture.parent_path() : path{"."};
  const std::string stem = capture.stem().string();
  std::error_code error;
  for (std::filesystem::directory_iterator entry{folder, error}, end; !error && entry != end; entry.increment(error)) {
    const path& file = entry->path();
    std::error_code vanished;
    if (file.extension() != ".json" || !entry->is_regular_file(vanished) || entry->file_size(vanished) > kMostBytes ||
        candidates.size() == kMostFiles)
      continue;
    Candidate& candidate = candidates.emplace_back(Candidate{file, file.stem() == stem || file.stem() == stem + "_0"});
    if (auto metadata = ouster::read_metadata(file))
      candidate.decoder.emplace(*metadata);
    else
      candidate.problem = metadata.error();
  }
  std::ranges::sort(candidates, {}, [](const Candidate& one) { return std::pair{!one.is_named, one.file}; });
  return candidates;
}

/// Marks the candidates that packets of the capture match. Returns whether any packet looks like an Ouster's.
bool compare(const path& file, std::vector<Candidate>& candidates) {
  auto capture = Capture::open(file);
  const auto packet = std::make_unique<LidarPacket>();
  bool looks_like_ouster = false;
  for (int looked_at = 0; capture && looked_at < kLookedAt; ++looked_at) {
    const Datagram* const datagram = capture->next();
    if (datagram == nullptr)
      break;
    looks_like_ouster = looks_like_ouster || other_maker(*datagram) == OtherMaker::ouster;
    for (Candidate& one : candidates)
      if (one.decoder && !one.port && !one.decoder->decode(datagram->payload, *packet))
        one.port = datagram->destination_port;
  }
  return looks_like_ouster;
}

bool is_file(const path& capture) {
  std::error_code ignored;
  return std::filesystem::is_regular_file(capture, ignored);
}

} // namespace

FoundMetadata find_metadata(const CaptureFolder& folder, Config& config) {
  const path& capture = folder.lidar.front();
  const auto is_ouster = [](const LidarOptions& lidar) { return lidar.is_ouster(); };
  if (!is_file(capture) || config.lidars.empty() || std::ranges::any_of(config.lidars, is_ouster))
    return {};
  std::vector<Candidate> candidates = candidates_beside(capture);
  if (candidates.empty())
    return {};
  const bool looks_like_ouster = compare(capture, candidates);
  FoundMetadata found;
  for (const Candidate& one : candidates)
    if (looks_like_ouster && one.is_named && !one.decoder)
      found.warnings.push_back(one.problem);
  const auto fits = [](const Candidate& one) { return one.port.has_value(); };
  const auto chosen = std::ranges::find_if(candidates, fits);
  if (chosen == candidates.end())
    return found;
  if (!chosen->is_named && std::ranges::count_if(candidates, fits) > 1) {
    found.warnings.push_back(fmt::format("{}: could be of {} as well as of other files beside it; name one: --set "
                                         "lidars.0.metadata=FILE --set lidars.0.port={}",
                                         capture.string(), chosen->file.string(), *chosen->port));
    return found;
  }
  LidarOptions& lidar = config.lidars.front();
  lidar.model.reset();
  lidar.metadata = chosen->file.string();
  lidar.port = *chosen->port;
  const ouster::Metadata& metadata = chosen->decoder->metadata();
  found.taken = fmt::format("{}: the metadata of lidar {}, {} with serial number {}; its packets go to port {}",
                            lidar.metadata, lidar.name, ouster::name_of(metadata), metadata.serial_number, lidar.port);
  return found;
}

void use_recorded_metadata(const CaptureFolder& folder, Config& config) {
  for (LidarOptions& lidar : config.lidars) {
    const path recorded = folder.lidar.front().parent_path() / metadata_file(lidar.name);
    if (lidar.is_ouster() && is_file(recorded))
      lidar.metadata = recorded.string();
  }
}

} // namespace locus::tools
