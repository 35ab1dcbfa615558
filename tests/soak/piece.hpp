// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace locus::soak {

/// What went in and came out since the process was begun, when all was at rest.
struct Counts {
  std::uint64_t datagrams_given = 0, datagrams_received = 0, data = 0, position = 0, rejected = 0;
  std::uint64_t samples_given = 0, samples_received = 0;          ///< of all motion sources
  std::uint64_t seen = 0, processed = 0, failed = 0, dropped = 0; ///< sweeps
  std::uint64_t fetched = 0, unfetched = 0;                       ///< estimates
};

/// What was found on one lap.
struct Piece {
  std::int64_t process_ns = 0;    ///< when the process was begun that drove it
  double hour = 0.0, lap_s = 0.0; ///< of stamps: at its end, how long
  std::string faults;
  int restarts = 0, resumed = 0;
  double rss_anon_mb = 0.0;
  int descriptors = 0;
  double cpu_p50_ms = 0.0, cpu_p99_ms = 0.0;         ///< of a sweep from its cut to its estimate
  double latency_p50_ms = 0.0, latency_p99_ms = 0.0; ///< the same by the clock on the wall
  double whole_cpu_ms = 0.0;                         ///< of the process for a sweep
  double ape_mean_mm = 0.0, ape_max_mm = 0.0;        ///< of the lap alone
  double astray_mm = 0.0; ///< from where the odometry began, at the end of the lap, which is there
  Counts counts;
};

/// One line of JSON each. Both throw tools::Failure.
void append(const std::filesystem::path& file, const Piece& piece);
std::vector<Piece> read_pieces(const std::filesystem::path& file);

} // namespace locus::soak
