// SPDX-License-Identifier: Apache-2.0
#include <benchmark/benchmark.h>
#include <fmt/core.h>
#include <pcl/filters/voxel_grid.h>
#include <pcl/point_types.h>
#include <pcl/registration/gicp.h>

#include <algorithm>
#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/odometry.hpp"
#include "recording.hpp"

namespace {

using namespace locus;
using Cloud = pcl::PointCloud<pcl::PointXYZ>;

constexpr int kRepetitions = 5;

OdometryOptions one_thread() {
  OdometryOptions options;
  options.threads = 1;
  return options;
}

struct NamedRecording {
  std::string name;
  test::Recording recording;
};

/// The whole of locus for each sweep of the recording: bytes, sweep, odometry, map. Lidar alone.
void locus_per_sweep(benchmark::State& state, const test::Recording& recording) {
  std::optional<test::SweepsOfRecording> sweeps;
  std::optional<Odometry> odometry;
  const auto start_over = [&] {
    sweeps.emplace(recording, SweepOptions{});
    odometry.emplace(one_thread());
  };
  start_over();
  for (auto _ : state) {
    Sweep* sweep = sweeps->next();
    if (sweep == nullptr) {
      state.PauseTiming();
      start_over();
      state.ResumeTiming();
      sweep = sweeps->next();
    }
    benchmark::DoNotOptimize(odometry->process(*sweep));
  }
}

/// The clouds of all sweeps of the recording, every return, as the filter of PCL gets them.
std::vector<Cloud::Ptr> clouds_of(const test::Recording& recording) {
  std::vector<Cloud::Ptr> clouds;
  test::SweepsOfRecording sweeps(recording, test::every_return());
  while (const Sweep* sweep = sweeps.next()) {
    auto cloud = std::make_shared<Cloud>();
    for (const SweepPoint& point : sweep->points)
      cloud->emplace_back(point.position_base_m.x(), point.position_base_m.y(), point.position_base_m.z());
    clouds.push_back(std::move(cloud));
  }
  return clouds;
}

Cloud::Ptr downsampled(const Cloud::Ptr& cloud) {
  constexpr float kLeaf_m = 0.25F;
  pcl::VoxelGrid<pcl::PointXYZ> filter;
  filter.setLeafSize(kLeaf_m, kLeaf_m, kLeaf_m);
  filter.setInputCloud(cloud);
  auto result = std::make_shared<Cloud>();
  filter.filter(*result);
  return result;
}

/// What LOCUS as published is built on, and scan to scan alone: filter the new sweep, register it with the one before.
/// Pairs from all over the recording.
void pcl_gicp_per_sweep(benchmark::State& state, const std::vector<Cloud::Ptr>& clouds) {
  pcl::GeneralizedIterativeClosestPoint<pcl::PointXYZ, pcl::PointXYZ> gicp;
  gicp.setMaxCorrespondenceDistance(1.0);
  Cloud aligned;
  const auto pairs = static_cast<std::size_t>(state.max_iterations);
  std::size_t pair = 0;
  for (auto _ : state) {
    state.PauseTiming();
    const std::size_t first = pair++ * (clouds.size() - 1) / pairs;
    const Cloud::Ptr last = downsampled(clouds[first]);
    state.ResumeTiming();
    const Cloud::Ptr now = downsampled(clouds[first + 1]);
    gicp.setInputSource(now);
    gicp.setInputTarget(last);
    gicp.align(aligned);
    benchmark::DoNotOptimize(gicp.getFinalTransformation());
    state.counters["points"] = static_cast<double>(now->size());
  }
}

void decode(benchmark::State& state, const test::Recording& recording) {
  std::optional<LidarInput> lidar;
  std::size_t next = recording.datagrams().size();
  for (auto _ : state) {
    if (next == recording.datagrams().size()) {
      state.PauseTiming();
      lidar.emplace(*LidarInput::open({}, 0));
      next = 0;
      state.ResumeTiming();
    }
    benchmark::DoNotOptimize(lidar->receive(recording.datagrams()[next++]));
  }
}

/// Decoding included: the difference to decode() times the packets of a sweep is the builder's.
void build(benchmark::State& state, const test::Recording& recording) {
  std::optional<test::SweepsOfRecording> sweeps(std::in_place, recording, SweepOptions{});
  for (auto _ : state) {
    if (const Sweep* sweep = sweeps->next())
      benchmark::DoNotOptimize(sweep->points.data());
    else
      sweeps.emplace(recording, SweepOptions{});
  }
}

std::vector<SurfacePoint> surfaces_of(const Sweep& sweep) {
  std::vector<SurfacePoint> surfaces;
  for (const SweepPoint& point : sweep.points)
    surfaces.push_back({point.position_base_m, point.normal_base});
  return surfaces;
}

void scan_normals(benchmark::State& state, const std::vector<Sweep>& sweeps) {
  std::vector<SweepPoint> points = sweeps[sweeps.size() / 2].points;
  std::sort(points.begin(), points.end(), [](const SweepPoint& a, const SweepPoint& b) {
    return a.scan_line != b.scan_line ? a.scan_line < b.scan_line : a.age_s > b.age_s;
  });
  ScanNormals normals(points.size());
  for (auto _ : state) {
    normals.estimate(points);
    benchmark::ClobberMemory();
  }
  state.counters["points"] = static_cast<double>(points.size());
}

void map_insert(benchmark::State& state, const std::vector<Sweep>& sweeps) {
  const std::vector<SurfacePoint> surfaces = surfaces_of(sweeps[sweeps.size() / 2]);
  SurfaceMap map(MapOptions{}.max_bytes);
  for (auto _ : state)
    map.insert(surfaces, Pose{});
  state.counters["points"] = static_cast<double>(surfaces.size());
}

void align(benchmark::State& state, const std::vector<Sweep>& sweeps) {
  const Sweep& before = sweeps[sweeps.size() / 2];
  const Sweep& now = sweeps[sweeps.size() / 2 + 1];
  std::vector<SurfacePoint> scan = surfaces_of(now);
  scan.resize(now.registered);
  SurfaceMap map(MapOptions{}.max_bytes);
  map.insert(surfaces_of(before), Pose{});
  Gicp gicp(1);
  Registration registration;
  for (auto _ : state)
    registration =
        gicp.align(scan, map, Pose{}, PosePrior{}, OdometryOptions{}.scan_to_submap, false, [] { return false; });
  state.counters["iterations"] = registration.iterations;
}

/// Shows the runs, and remembers the median of each.
class Medians : public benchmark::ConsoleReporter {
 public:
  void ReportRuns(const std::vector<Run>& runs) override {
    ConsoleReporter::ReportRuns(runs);
    for (const Run& run : runs)
      if (run.aggregate_name == "median")
        cpu_ms_[run.run_name.function_name] = run.GetAdjustedCPUTime();
  }
  [[nodiscard]] std::optional<double> cpu_ms(const std::string& name) const {
    const auto found = cpu_ms_.find(name);
    return found == cpu_ms_.end() ? std::nullopt : std::optional{found->second};
  }

 private:
  std::map<std::string, double> cpu_ms_;
};

std::vector<NamedRecording> recordings() {
  std::vector<NamedRecording> all;
  all.push_back({"vlp16_plant_synthetic", test::plant_recording(std::chrono::seconds{20})});
  for (const std::string name : {"hdl32e_moving_15mps", "hdl32e_static_monterey", "vlp16_static_1200rpm_product21"})
    if (std::optional<test::Recording> recording = test::Recording::real(name))
      all.push_back({name, std::move(*recording)});
  return all;
}

template <class Body> void add(const std::string& name, std::size_t iterations, const Body& body) {
  benchmark::RegisterBenchmark(name.c_str(), body)
      ->Iterations(static_cast<benchmark::IterationCount>(iterations))
      ->Repetitions(kRepetitions)
      ->ReportAggregatesOnly()
      ->Unit(benchmark::kMillisecond);
}

} // namespace

int main(int argc, char** argv) {
  constexpr std::size_t kMostPclPairs = 25; // up to a tenth of a second each
  benchmark::Initialize(&argc, argv);
  const std::vector<NamedRecording> all = recordings();
  std::map<std::string, std::vector<Cloud::Ptr>> clouds;
  for (const auto& [name, recording] : all) {
    clouds[name] = clouds_of(recording);
    const std::size_t sweeps = clouds[name].size();
    add("locus/" + name, sweeps, [&recording = recording](auto& state) { locus_per_sweep(state, recording); });
    add("pcl_gicp/" + name, std::min(sweeps - 1, kMostPclPairs),
        [&pairs = clouds[name]](auto& state) { pcl_gicp_per_sweep(state, pairs); });
  }

  const test::Recording& plant = all.front().recording;
  const std::vector<Sweep> sweeps = test::sweeps_of(plant, SweepOptions{});
  add("part/decode_packet", plant.datagrams().size(), [&](auto& state) { decode(state, plant); });
  add("part/decode_and_build_sweep", sweeps.size(), [&](auto& state) { build(state, plant); });
  add("part/scan_normals", 500, [&](auto& state) { scan_normals(state, sweeps); });
  add("part/map_insert", 500, [&](auto& state) { map_insert(state, sweeps); });
  add("part/align", 500, [&](auto& state) { align(state, sweeps); });

  Medians medians;
  benchmark::RunSpecifiedBenchmarks(&medians);
  fmt::print("\nCPU time of one sweep, one thread, medians of {} repetitions\n", kRepetitions);
  for (const auto& [name, recording] : all) {
    const auto ours = medians.cpu_ms("locus/" + name);
    const auto theirs = medians.cpu_ms("pcl_gicp/" + name);
    if (ours && theirs)
      fmt::print("{:32} locus {:7.3f} ms   pcl gicp {:8.2f} ms   ratio 1/{:.0f}\n", name, *ours, *theirs,
                 *theirs / *ours);
  }
}
