// SPDX-License-Identifier: Apache-2.0
// PCL's counterparts of the parts of locus: one thread, PCL's defaults.
#include <pcl/features/normal_3d.h>
#include <pcl/filters/voxel_grid.h>
#include <pcl/point_types.h>
#include <pcl/registration/gicp.h>
#include <pcl/search/kdtree.h>

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "suite.hpp"

namespace locus::performance {

namespace {

using Cloud = pcl::PointCloud<pcl::PointXYZ>;
using Clouds = std::vector<Cloud::Ptr>;

/// A sweep takes PCL up to 0.2 s: this number represents a capture.
constexpr std::size_t kMostSweeps = 16;

/// Returns the clouds of all sweeps of a capture with every return, as inputs of PCL's filter.
Clouds clouds_of(const Capture& capture) {
  Config config = capture.config();
  config.sweep.segment_filter.enabled = false;
  Playback playback(capture, config);
  Clouds clouds;
  while (playback.next() != nullptr) {
    auto cloud = std::make_shared<Cloud>();
    for (const SweepPoint& point : playback.pipeline().points())
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

/// Returns the index of the cloud for an iteration, spread over the capture.
std::size_t cloud_for(std::size_t iteration, const Clouds& clouds, const benchmark::State& state) {
  return iteration * (clouds.size() - 1) / static_cast<std::size_t>(state.max_iterations);
}

/// The basis of LOCUS as published, scan-to-scan only: filters the new sweep and registers it with the previous one.
void gicp(benchmark::State& state, const Clouds& clouds) {
  pcl::GeneralizedIterativeClosestPoint<pcl::PointXYZ, pcl::PointXYZ> gicp;
  gicp.setMaxCorrespondenceDistance(1.0);
  Cloud aligned;
  std::size_t iteration = 0;
  double points = 0;
  for (auto _ : state) {
    state.PauseTiming();
    const std::size_t first = cloud_for(iteration++, clouds, state);
    const Cloud::Ptr last = downsampled(clouds[first]);
    state.ResumeTiming();
    const Cloud::Ptr now = downsampled(clouds[first + 1]);
    gicp.setInputSource(now);
    gicp.setInputTarget(last);
    gicp.align(aligned);
    benchmark::DoNotOptimize(gicp.getFinalTransformation());
    points += static_cast<double>(now->size());
  }
  state.counters["points"] = points / static_cast<double>(iteration);
}

void voxel_grid(benchmark::State& state, const Clouds& clouds) {
  std::size_t iteration = 0;
  for (auto _ : state)
    benchmark::DoNotOptimize(downsampled(clouds[cloud_for(iteration++, clouds, state)]));
}

/// Normals of the filtered cloud, with the number of neighbours that PCL's GICP uses.
void normals(benchmark::State& state, const Clouds& clouds) {
  constexpr int kNeighbours = 20;
  pcl::NormalEstimation<pcl::PointXYZ, pcl::Normal> estimation;
  estimation.setSearchMethod(std::make_shared<pcl::search::KdTree<pcl::PointXYZ>>());
  estimation.setKSearch(kNeighbours);
  pcl::PointCloud<pcl::Normal> found;
  std::size_t iteration = 0;
  for (auto _ : state) {
    state.PauseTiming();
    const Cloud::Ptr cloud = downsampled(clouds[cloud_for(iteration++, clouds, state)]);
    state.ResumeTiming();
    estimation.setInputCloud(cloud);
    estimation.compute(found);
    benchmark::DoNotOptimize(found.size());
  }
}

} // namespace

void add_pcl(const Effort& effort, const Capture& capture) {
  const auto clouds = std::make_shared<const Clouds>(clouds_of(capture));
  const std::size_t sweeps = std::min(clouds->size() - 1, kMostSweeps);
  add("pcl_gicp/" + capture.name(), effort, sweeps, [clouds](auto& state) { gicp(state, *clouds); });
  add("pcl_voxel_grid/" + capture.name(), effort, sweeps, [clouds](auto& state) { voxel_grid(state, *clouds); });
  add("pcl_normals/" + capture.name(), effort, sweeps, [clouds](auto& state) { normals(state, *clouds); });
}

} // namespace locus::performance
