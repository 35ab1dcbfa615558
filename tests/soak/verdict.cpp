// SPDX-License-Identifier: Apache-2.0
#include "verdict.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include <fmt/format.h>

#include "locus_replay/quantiles.hpp"

namespace locus::soak {

namespace {

constexpr double kMostGrowth_mb_per_hour = 1.0;
constexpr double kMostDrift = 1.25;
constexpr double kMostError_mm = 50.0;
constexpr double kTurns_hz = 10.0;
constexpr double kSettling_h = 1.0, kLeastSpan_h = 1.0, kCompared_h = 1.0;

std::optional<double> growth_of(std::span<const Piece> pieces) {
  struct Level {
    std::vector<double> hours, mb;
  };
  std::map<std::int64_t, double> begun_h;
  std::map<std::pair<std::int64_t, bool>, Level> levels;
  for (const Piece& piece : pieces) {
    const double begun = begun_h.try_emplace(piece.process_ns, piece.hour - piece.lap_s / 3600.0).first->second;
    if (piece.hour - begun <= kSettling_h)
      continue;
    Level& level = levels[{piece.process_ns, piece.restarts > 0}];
    level.hours.push_back(piece.hour);
    level.mb.push_back(piece.rss_anon_mb);
  }
  double together = 0.0, spread = 0.0, span_h = 0.0;
  for (const auto& [key, level] : levels) {
    const auto count = static_cast<double>(level.hours.size());
    double mean_h = 0.0, mean_mb = 0.0;
    for (std::size_t i = 0; i < level.hours.size(); ++i) {
      mean_h += level.hours[i] / count;
      mean_mb += level.mb[i] / count;
    }
    for (std::size_t i = 0; i < level.hours.size(); ++i) {
      together += (level.hours[i] - mean_h) * (level.mb[i] - mean_mb);
      spread += (level.hours[i] - mean_h) * (level.hours[i] - mean_h);
    }
    span_h += level.hours.back() - level.hours.front();
  }
  return span_h >= kLeastSpan_h ? std::optional(together / spread) : std::nullopt;
}

std::optional<double> drift_of(std::span<const Piece> pieces, double Piece::*figure) {
  std::vector<double> first, last;
  for (const Piece& piece : pieces) {
    if (piece.hour <= kCompared_h)
      first.push_back(piece.*figure);
    if (piece.hour > pieces.back().hour - kCompared_h)
      last.push_back(piece.*figure);
  }
  if (pieces.back().hour < 2.0 * kCompared_h || first.empty())
    return std::nullopt;
  return tools::Quantiles(last).at(0.5) / tools::Quantiles(first).at(0.5);
}

/// Returns the violations within this piece.
std::vector<std::string> faults_of(const Piece& piece, const Piece& first_of_process) {
  const Counts& c = piece.counts;
  std::vector<std::string> faults;
  const auto demand = [&](bool holds, const std::string& otherwise) {
    if (!holds)
      faults.push_back(fmt::format("hour {:.2f} ({}): {}", piece.hour, piece.faults, otherwise));
  };
  demand(c.datagrams_given == c.datagrams_received,
         fmt::format("{} datagrams in, {} received", c.datagrams_given, c.datagrams_received));
  demand(c.datagrams_received == c.data + c.position + c.rejected,
         fmt::format("{} datagrams, {} data + {} position + {} rejected", c.datagrams_received, c.data, c.position,
                     c.rejected));
  demand(c.samples_given == c.samples_received,
         fmt::format("{} motion samples in, {} received", c.samples_given, c.samples_received));
  demand(c.dropped == 0, fmt::format("{} sweeps dropped", c.dropped));
  demand(c.seen == c.processed + c.failed + c.dropped,
         fmt::format("{} sweeps, {} processed + {} failed + {} dropped", c.seen, c.processed, c.failed, c.dropped));
  demand(c.fetched == c.processed + c.failed && c.unfetched == 0,
         fmt::format("{} estimates fetched and {} not, of {}", c.fetched, c.unfetched, c.processed + c.failed));
  demand(piece.descriptors == first_of_process.descriptors,
         fmt::format("{} descriptors, {} at first", piece.descriptors, first_of_process.descriptors));
  demand(piece.resumed == piece.restarts, fmt::format("resumed {} of {} times", piece.resumed, piece.restarts));
  demand(piece.ape_mean_mm <= kMostError_mm, fmt::format("mean error {:.1f} mm", piece.ape_mean_mm));
  return faults;
}

/// A silent lidar produces sweeps, too. A restart loses those of its pause and the incomplete one.
std::optional<std::string> missing_sweeps(std::span<const Piece> pieces) {
  constexpr double kOfRestart = 13.0, kOfProcess = 3.0;
  std::map<std::int64_t, double> expected, least, found;
  for (const Piece& piece : pieces) {
    const double turns = std::round(kTurns_hz * piece.lap_s); // a whole number per lap
    expected[piece.process_ns] += turns;
    least[piece.process_ns] += turns - kOfRestart * piece.restarts;
    found[piece.process_ns] = static_cast<double>(piece.counts.seen);
  }
  for (const auto& [process, seen] : found)
    if (seen < least[process] - kOfProcess || seen > expected[process] + kOfProcess)
      return fmt::format("{:.0f} sweeps of {:.0f} revolutions of the lidar", seen, expected[process]);
  return std::nullopt;
}

} // namespace

Verdict judge(std::span<const Piece> pieces) {
  Verdict verdict;
  if (pieces.empty())
    return verdict;
  verdict.growth_mb_per_hour = growth_of(pieces);
  verdict.cpu_drift = drift_of(pieces, &Piece::cpu_p50_ms);
  verdict.latency_drift = drift_of(pieces, &Piece::latency_p50_ms);
  std::map<std::int64_t, const Piece*> first;
  for (const Piece& piece : pieces)
    for (std::string& fault : faults_of(piece, *first.try_emplace(piece.process_ns, &piece).first->second))
      verdict.broken.push_back(std::move(fault));
  if (auto missing = missing_sweeps(pieces))
    verdict.broken.push_back(*std::move(missing));
  if (verdict.growth_mb_per_hour.value_or(0.0) > kMostGrowth_mb_per_hour)
    verdict.broken.push_back(fmt::format("memory grows by {:.2f} MB an hour", *verdict.growth_mb_per_hour));
  if (verdict.cpu_drift.value_or(1.0) > kMostDrift)
    verdict.broken.push_back(fmt::format("CPU per sweep is {:.2f} times the initial one", *verdict.cpu_drift));
  if (verdict.latency_drift.value_or(1.0) > kMostDrift)
    verdict.broken.push_back(fmt::format("latency is {:.2f} times the initial one", *verdict.latency_drift));
  return verdict;
}

} // namespace locus::soak
