// SPDX-License-Identifier: Apache-2.0
#include "piece.hpp"

#include <fstream>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "locus_replay/failure.hpp"

namespace locus::soak {

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Counts, datagrams_given, datagrams_received, data, position, rejected, samples_given,
                                   samples_received, seen, processed, failed, dropped, fetched, unfetched)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Piece, process_ns, hour, lap_s, faults, restarts, resumed, rss_anon_mb, descriptors,
                                   cpu_p50_ms, cpu_p99_ms, latency_p50_ms, latency_p99_ms, whole_cpu_ms, ape_mean_mm,
                                   ape_max_mm, astray_mm, counts)

void append(const std::filesystem::path& file, const Piece& piece) {
  std::ofstream stream(file, std::ios::app);
  stream << nlohmann::json(piece).dump() << '\n' << std::flush;
  if (!stream)
    throw tools::Failure(tools::ExitStatus::failed,
                         fmt::format("{}: cannot be written; check permissions and free space", file.string()));
}

std::vector<Piece> read_pieces(const std::filesystem::path& file) {
  std::vector<Piece> pieces;
  std::ifstream stream(file);
  for (std::string line; std::getline(stream, line);) {
    const auto json = nlohmann::json::parse(line, nullptr, false);
    if (json.is_discarded())
      throw tools::Failure(tools::ExitStatus::failed,
                           fmt::format("{}:{}: is no line of figures; take it out", file.string(), pieces.size() + 1));
    pieces.push_back(json.get<Piece>());
  }
  return pieces;
}

} // namespace locus::soak
