// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace locus::soak {

/// Inputs and outputs since the start of the process, read while all threads are at rest.
struct Counts {
  std::uint64_t datagrams_given = 0, datagrams_received = 0, data = 0, position = 0, rejected = 0;
  std::uint64_t samples_given = 0, samples_received = 0;          ///< of all motion sources
  std::uint64_t seen = 0, processed = 0, failed = 0, dropped = 0; ///< sweeps
  std::uint64_t fetched = 0, unfetched = 0;                       ///< estimates
};

/// Measurements of one lap.
struct Piece {
  std::int64_t process_ns = 0;    ///< start time of the process that drove it
  double hour = 0.0, lap_s = 0.0; ///< in stamps: time at its end, duration
  std::string faults;
  int restarts = 0, resumed = 0;
  double rss_anon_mb = 0.0;
  int descriptors = 0;
  double cpu_p50_ms = 0.0, cpu_p99_ms = 0.0;         ///< per sweep, from its cut to its estimate
  double latency_p50_ms = 0.0, latency_p99_ms = 0.0; ///< the same in wall time
  double whole_cpu_ms = 0.0;                         ///< of the whole process per sweep
  double ape_mean_mm = 0.0, ape_max_mm = 0.0;        ///< of this lap alone
  double astray_mm = 0.0; ///< distance to the start of the odometry at the end of the lap, where it is truly zero
  Counts counts;
};

/// Appends or reads one line of JSON per piece. Both throw tools::Failure.
void append(const std::filesystem::path& file, const Piece& piece);
std::vector<Piece> read_pieces(const std::filesystem::path& file);

} // namespace locus::soak
