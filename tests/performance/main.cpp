// SPDX-License-Identifier: Apache-2.0
// locus_benchmark [--smoke] [Google Benchmark's options]: cost of locus, whole and in parts, compared with PCL and with
// lower bounds, and its scaling. One thread unless stated otherwise; CPU time, medians of repetitions in random order.
// tests/performance/measure.py runs it and writes docs/performance.md.
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <pcl/pcl_config.h>

#include "suite.hpp"

namespace {

using namespace locus;
using namespace locus::performance;

/// Prints one line per benchmark, and stores its median.
class Medians : public benchmark::BenchmarkReporter {
 public:
  bool ReportContext(const Context&) override { return true; }
  void ReportRuns(const std::vector<Run>& runs) override {
    for (const Run& run : runs) {
      if (run.error_occurred)
        fmt::print("{}: {}\n", run.run_name.function_name, run.error_message);
      if (run.error_occurred || (run.aggregate_name != "median" && run.repetitions > 1))
        continue;
      medians_.insert_or_assign(run.run_name.function_name, run);
      fmt::print("{:45} {:12.4f} {} of CPU\n", run.run_name.function_name, run.GetAdjustedCPUTime(),
                 benchmark::GetTimeUnitString(run.time_unit));
    }
  }

  /// Median of a benchmark in milliseconds.
  [[nodiscard]] std::optional<double> cpu_ms(const std::string& name) const {
    const auto found = medians_.find(name);
    return found == medians_.end() ? std::nullopt : std::optional{found->second.GetAdjustedCPUTime()};
  }
  /// Sum of its stages.
  [[nodiscard]] std::optional<double> stages_ms(const std::string& name, const std::vector<std::string>& stages) const {
    const auto found = medians_.find(name);
    if (found == medians_.end())
      return std::nullopt;
    double sum_ms = 0;
    for (const std::string& stage : stages)
      sum_ms += found->second.counters.at(stage + "_ms").value;
    return sum_ms;
  }

 private:
  std::map<std::string, Run> medians_;
};

/// Different environments, each with and without motion sources, and the real captures if available.
std::vector<std::unique_ptr<const Capture>> make_captures(const Effort& effort) {
  std::vector<std::unique_ptr<const Capture>> all;
  const auto drive = [&](const std::string& name, sim::WorldMaker world) {
    SimulatedRobot robot(world, {}, effort.drive());
    all.push_back(std::make_unique<const Capture>(name, robot));
  };
  drive("plant", sim::make_urban);
  drive("mine", sim::make_tunnel);
  all.push_back(std::make_unique<const Capture>("halls", test::plant_recording(effort.drive())));
  for (const std::string name : {"hdl32e_moving_15mps", "hdl32e_static_monterey", "vlp16_static_1200rpm_product21"})
    if (std::optional<test::Recording> recording = test::Recording::real(name))
      all.push_back(std::make_unique<const Capture>(name, std::move(*recording)));
  return all;
}

void print_ratio(const std::string& capture, std::string_view what, std::optional<double> ours_ms,
                 std::optional<double> theirs_ms) {
  if (ours_ms && theirs_ms)
    fmt::print("{:32} {:28} locus {:7.3f} ms   pcl {:8.2f} ms   ratio 1/{:.0f}\n", capture, what, *ours_ms, *theirs_ms,
               *theirs_ms / *ours_ms);
}

void print_ratios(const std::vector<std::unique_ptr<const Capture>>& captures, const Medians& medians) {
  fmt::print("\nCPU time of one sweep beside PCL, one thread\n");
  for (const auto& capture : captures) {
    const std::string& name = capture->name();
    const std::string alone = "pipeline/" + name + "/lidar", aided = "pipeline/" + name + "/wheels_gyro";
    const std::optional<double> gicp_ms = medians.cpu_ms("pcl_gicp/" + name);
    print_ratio(name, "all, lidar alone / GICP", medians.cpu_ms(alone), gicp_ms);
    print_ratio(name, "all, wheels and gyro / GICP", medians.cpu_ms(aided), gicp_ms);
    print_ratio(name, "sweep filter / VoxelGrid", medians.stages_ms(alone, {"correct", "filter"}),
                medians.cpu_ms("pcl_voxel_grid/" + name));
    print_ratio(name, "normals / NormalEstimation", medians.stages_ms(alone, {"covariance"}),
                medians.cpu_ms("pcl_normals/" + name));
  }
}

/// Removes the option; returns whether it was present.
bool take_option(std::vector<char*>& arguments, std::string_view option) {
  return std::erase_if(arguments, [&](const char* argument) { return argument == option; }) > 0;
}

} // namespace

int main(int argc, char** argv) {
  std::vector<char*> arguments(argv, argv + argc);
  const Effort effort{take_option(arguments, "--smoke")};
  std::string interleaved = "--benchmark_enable_random_interleaving=true"; // spreads temporary load over all medians
  arguments.insert(arguments.begin() + 1, interleaved.data());
  auto count = static_cast<int>(arguments.size());
  benchmark::Initialize(&count, arguments.data());
  if (benchmark::ReportUnrecognizedArguments(count, arguments.data()))
    return 2;
  benchmark::AddCustomContext("compiler", "g++ " __VERSION__);
  benchmark::AddCustomContext("pcl", PCL_VERSION_PRETTY);
  benchmark::AddCustomContext("isa", std::string(to_string(best_isa())));
  benchmark::AddCustomContext("repetitions", std::to_string(effort.repetitions()));

  const auto captures = make_captures(effort);
  for (const auto& capture : captures) {
    add_pipelines(effort, *capture);
    add_pcl(effort, *capture);
    add_floors(effort, *capture);
  }
  add_decoders(effort);
  add_hesai_decoders(effort);
  add_ouster_decoders(effort);
  add_scaling(effort);

  Medians medians;
  benchmark::RunSpecifiedBenchmarks(&medians);
  print_ratios(captures, medians);
}
