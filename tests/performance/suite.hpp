// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <string>

#include <benchmark/benchmark.h>

#include "capture.hpp"
#include "pipeline.hpp"

namespace locus::performance {

/// Amount of work: everything for the page, or a smoke test.
struct Effort {
  bool smoke = false;

  [[nodiscard]] int repetitions() const { return smoke ? 1 : 5; }
  [[nodiscard]] Duration drive() const { return std::chrono::seconds{smoke ? 2 : 30}; }
  [[nodiscard]] Duration short_drive() const { return std::chrono::seconds{smoke ? 1 : 4}; }
  [[nodiscard]] std::size_t iterations(std::size_t all) const { return smoke ? std::min<std::size_t>(all, 2) : all; }
};

/// Adds a benchmark with a fixed number of iterations per repetition, so that all repetitions process the same sweeps.
template <class Body>
benchmark::internal::Benchmark* add(const std::string& name, const Effort& effort, std::size_t iterations,
                                    const Body& body) {
  return benchmark::RegisterBenchmark(name.c_str(), body)
      ->Iterations(static_cast<benchmark::IterationCount>(effort.iterations(iterations)))
      ->Repetitions(effort.repetitions())
      ->ReportAggregatesOnly(!effort.smoke)
      ->Unit(benchmark::kMillisecond);
}

/// Adds the complete pipeline per sweep of the capture, with the time of each stage as counters.
void add_pipeline(const std::string& name, const Effort& effort, const Capture& capture, const Config& config);

/// Benchmarks, file by file. Captures must outlive the benchmarks.
void add_pipelines(const Effort& effort, const Capture& capture);
void add_pcl(const Effort& effort, const Capture& capture);
void add_floors(const Effort& effort, const Capture& capture);
void add_decoders(const Effort& effort);
void add_hesai_decoders(const Effort& effort);
void add_ouster_decoders(const Effort& effort);
void add_scaling(const Effort& effort);

} // namespace locus::performance
