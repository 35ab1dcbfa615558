// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <string>

#include <benchmark/benchmark.h>

#include "capture.hpp"
#include "pipeline.hpp"

namespace locus::performance {

/// How much is run: all that the page is made of, or a glance at everything.
struct Effort {
  bool smoke = false;

  [[nodiscard]] int repetitions() const { return smoke ? 1 : 5; }
  [[nodiscard]] Duration drive() const { return std::chrono::seconds{smoke ? 2 : 30}; }
  [[nodiscard]] Duration short_drive() const { return std::chrono::seconds{smoke ? 1 : 4}; }
  [[nodiscard]] std::size_t iterations(std::size_t all) const { return smoke ? std::min<std::size_t>(all, 2) : all; }
};

/// Adds a benchmark whose every repetition does the same number of iterations, so that it sees the same sweeps.
template <class Body>
benchmark::internal::Benchmark* add(const std::string& name, const Effort& effort, std::size_t iterations,
                                    const Body& body) {
  return benchmark::RegisterBenchmark(name.c_str(), body)
      ->Iterations(static_cast<benchmark::IterationCount>(effort.iterations(iterations)))
      ->Repetitions(effort.repetitions())
      ->ReportAggregatesOnly(!effort.smoke)
      ->Unit(benchmark::kMillisecond);
}

/// The whole of locus for each sweep of the capture, with where the time goes as counters.
void add_pipeline(const std::string& name, const Effort& effort, const Capture& capture, const Config& config);

/// What the benchmarks measure, file by file. Captures must live as long as the benchmarks run.
void add_pipelines(const Effort& effort, const Capture& capture);
void add_pcl(const Effort& effort, const Capture& capture);
void add_floors(const Effort& effort, const Capture& capture);
void add_decoders(const Effort& effort);
void add_hesai_decoders(const Effort& effort);
void add_ouster_decoders(const Effort& effort);
void add_scaling(const Effort& effort);

} // namespace locus::performance
