// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/ouster_metadata.hpp"

#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "bags/bag.hpp"
#include "bags/messages.hpp"
#include "drivers/files/capture.hpp"
#include "drivers/other_maker.hpp"
#include "drivers/ouster/decoder.hpp"
#include "locus_replay/bag_topics.hpp"

namespace locus::tools {
namespace {

using std::filesystem::path;

constexpr int kLookedAt = 2000;         ///< packets at the start of the recording; three seconds of an Ouster's
constexpr std::size_t kMostFiles = 100; ///< a folder with more is not one to search for metadata
constexpr std::uintmax_t kMostBytes = 1'000'000;
constexpr std::string_view kStringType = "std_msgs/String";

/// Text that may be the metadata of the sensor.
struct Candidate {
  std::string origin; ///< file, or topic of a bag
  bool is_named;      ///< named after the recording, or in it
  std::string text{}; ///< of a topic
  std::optional<ouster::Decoder> decoder{};
  std::string problem{};               ///< reason not to use it
  std::optional<std::uint16_t> port{}; ///< destination of packets that match it
};

/// Result of comparing the candidates with the packets of a recording.
struct Comparison {
  std::vector<Candidate> candidates; ///< those named after the recording first
  bool looks_like_ouster = false;
};

void add_candidates_in(const path& folder, const std::string& stem, std::vector<Candidate>& candidates) {
  std::error_code error;
  for (std::filesystem::directory_iterator entry{folder, error}, end; !error && entry != end; entry.increment(error)) {
    const path& file = entry->path();
    std::error_code vanished;
    if (file.extension() != ".json" || !entry->is_regular_file(vanished) || entry->file_size(vanished) > kMostBytes ||
        candidates.size() == kMostFiles)
      continue;
    Candidate& candidate =
        candidates.emplace_back(Candidate{file.string(), file.stem() == stem || file.stem() == stem + "_0"});
    if (auto metadata = ouster::read_metadata(file))
      candidate.decoder.emplace(*metadata);
    else
      candidate.problem = metadata.error();
  }
}

/// Lists the .json files beside a recording, and in the folder of a bag.
std::vector<Candidate> candidates_beside(const path& recording) {
  std::vector<Candidate> candidates;
  std::error_code ignored;
  if (std::filesystem::is_directory(recording, ignored))
    add_candidates_in(recording, recording.stem().string(), candidates);
  add_candidates_in(recording.has_parent_path() ? recording.parent_path() : path{"."}, recording.stem().string(),
                    candidates);
  std::ranges::sort(candidates, {}, [](const Candidate& one) { return std::pair{!one.is_named, one.origin}; });
  return candidates;
}

/// Marks the candidates that a packet matches.
void compare(std::span<const std::byte> packet, std::uint16_t port, LidarPacket& decoded,
             std::vector<Candidate>& candidates) {
  for (Candidate& one : candidates)
    if (one.decoder && !one.port && !one.decoder->decode(packet, decoded))
      one.port = port;
}

Comparison compare_capture(const path& file) {
  Comparison found{candidates_beside(file)};
  if (found.candidates.empty())
    return found;
  auto capture = Capture::open(file);
  const auto packet = std::make_unique<LidarPacket>();
  for (int looked_at = 0; capture && looked_at < kLookedAt; ++looked_at) {
    const Datagram* const datagram = capture->next();
    if (datagram == nullptr)
      break;
    found.looks_like_ouster = found.looks_like_ouster || other_maker(*datagram) == OtherMaker::ouster;
    compare(datagram->payload, datagram->destination_port, *packet, found.candidates);
  }
  return found;
}

std::optional<Candidate> candidate_of(const BagTopic& topic, const BagMessage& message, const path& bag) {
  Candidate candidate{fmt::format("{}: {}", bag.string(), topic.name), true};
  candidate.text = MessageReader(message.data, topic.serialisation).text();
  auto metadata = ouster::parse_metadata(candidate.text);
  if (!metadata)
    return std::nullopt;
  candidate.decoder.emplace(*metadata);
  return candidate;
}

/// Compares the packets of the first lidar topic that has metadata beside it, else those of all, with the files beside
/// the bag. A topic of metadata that names the lidar comes first.
Comparison compare_bag(const path& file, const std::string& lidar) {
  Comparison found;
  const auto bag = open_bag(file);
  if (!bag || std::ranges::none_of((*bag)->topics(), [](const BagTopic& t) { return is_ouster_type(t.type); }))
    return found; // an unreadable bag is reported when it is opened for playing
  found.looks_like_ouster = true;
  found.candidates = candidates_beside(file);
  const auto packet = std::make_unique<LidarPacket>();
  const auto fits = [](const Candidate& one) { return !one.text.empty() && one.port.has_value(); };
  int looked_at = 0;
  const BagMessage* message = (*bag)->next();
  for (; message != nullptr && looked_at < kLookedAt && std::ranges::none_of(found.candidates, fits);
       message = (*bag)->next()) {
    const BagTopic& topic = (*bag)->topics()[message->topic];
    const bool is_metadata = topic.type == kStringType && topic.name.ends_with("metadata");
    if (is_metadata && found.candidates.size() < 2 * kMostFiles && message->data.size() <= kMostBytes) {
      if (auto candidate = candidate_of(topic, *message, file))
        found.candidates.insert(topic.name.find(lidar) != std::string::npos ? found.candidates.begin()
                                                                            : found.candidates.end(),
                                std::move(*candidate));
    }
    if (!is_ouster_type(topic.type) || !are_lidar_packets(topic))
      continue;
    ++looked_at;
    if (const auto packets = packet_type(topic.type)->read({message->data, topic.serialisation}))
      compare(packets->bytes, 0, *packet, found.candidates);
  }
  std::ranges::stable_sort(found.candidates, {}, [](const Candidate& one) { return one.text.empty(); });
  return found;
}

bool is_file(const path& capture) {
  std::error_code ignored;
  return std::filesystem::is_regular_file(capture, ignored);
}

} // namespace

FoundMetadata find_metadata(const CaptureFolder& folder, Config& config) {
  const path& recording = folder.lidar.front();
  const bool is_bag = looks_like_bag(recording);
  if ((!is_bag && !is_file(recording)) || config.lidars.empty() || config.lidars.front().gives_clouds() ||
      std::ranges::any_of(config.lidars, [](const LidarOptions& lidar) { return lidar.is_ouster(); }))
    return {};
  LidarOptions& lidar = config.lidars.front();
  const auto [candidates, looks_like_ouster] = is_bag ? compare_bag(recording, lidar.name) : compare_capture(recording);
  FoundMetadata found;
  for (const Candidate& one : candidates)
    if (looks_like_ouster && one.is_named && !one.decoder)
      found.warnings.push_back(one.problem);
  const auto fits = [](const Candidate& one) { return one.port.has_value(); };
  const auto chosen = std::ranges::find_if(candidates, fits);
  if (chosen == candidates.end())
    return found;
  const std::uint16_t port = is_bag ? chosen->decoder->metadata().lidar_port : *chosen->port;
  if (!chosen->is_named && std::ranges::count_if(candidates, fits) > 1) {
    found.warnings.push_back(fmt::format("{}: matches {} as well as other files beside it; name one: --set "
                                         "lidars.0.metadata=FILE --set lidars.0.port={}",
                                         recording.string(), chosen->origin, port));
    return found;
  }
  lidar.model.reset();
  lidar.metadata = chosen->origin;
  lidar.metadata_text = chosen->text;
  lidar.port = port;
  const ouster::Metadata& metadata = chosen->decoder->metadata();
  found.used = fmt::format("{}: the metadata of lidar {}, {} with serial number {}", lidar.metadata, lidar.name,
                           ouster::name_of(metadata), metadata.serial_number);
  if (!is_bag)
    found.used += fmt::format("; its packets go to port {}", lidar.port);
  return found;
}

bool has_metadata(const path& bag) {
  CaptureFolder folder;
  folder.lidar = {bag};
  Config config;
  return !find_metadata(folder, config).used.empty();
}

void use_recorded_metadata(const CaptureFolder& folder, Config& config) {
  for (LidarOptions& lidar : config.lidars) {
    const path recorded = folder.lidar.front().parent_path() / metadata_file(lidar.name);
    if (lidar.is_ouster() && is_file(recorded))
      lidar.metadata = recorded.string();
  }
}

} // namespace locus::tools
