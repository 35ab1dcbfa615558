// SPDX-License-Identifier: Apache-2.0
#include "daemon/service/cloud_publisher.hpp"

#include <utility>

#include "daemon/dds/sweep_points.hpp"

namespace locus::daemon {

namespace {

constexpr Duration kMapPeriod = std::chrono::seconds{5};

/// Collects the coarse surfaces, some ten thousand for a map of maximum size.
void map_points(const SurfaceGrid& grid, std::vector<CloudMessage::Point>& out) {
  out.clear();
  grid.for_each([&](const Eigen::Vector3d& mean_m, const Surface& surface) {
    const Eigen::Vector3f p = mean_m.cast<float>();
    if (surface.planar())
      out.push_back({p.x(), p.y(), p.z(), 0, 0, 0, 0});
  });
}

} // namespace

CloudPublisher::CloudPublisher(DdsOptions options, RosLink& link) : options_(std::move(options)), link_(link) {
  if (options_.publish_cloud || options_.publish_map)
    worker_.emplace("clouds", std::chrono::milliseconds{100}, [this](bool /*last*/) { publish(); });
}

void CloudPublisher::submit(const Sweep& sweep, const Odometry& odometry, const OdometryEstimate& estimate) {
  if (options_.publish_cloud) {
    sweep_points(sweep.points, odometry.scan(), sweep_.back().points);
    sweep_.back().stamp = estimate.stamp;
    static_cast<void>(sweep_.publish());
  }
  if (options_.publish_map && std::chrono::abs(estimate.stamp - map_published_) > kMapPeriod) {
    map_points(odometry.map().coarse(), map_.back().points);
    map_.back().stamp = map_published_ = estimate.stamp;
    static_cast<void>(map_.publish());
  }
  if (worker_)
    worker_->notify();
}

void CloudPublisher::publish() {
  if (const Cloud* sweep = sweep_.poll())
    link_.publish_cloud(sweep->points, sweep->stamp);
  if (const Cloud* map = map_.poll())
    link_.publish_map(map->points, map->stamp);
}

} // namespace locus::daemon
