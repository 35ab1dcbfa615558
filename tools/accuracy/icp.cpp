// SPDX-License-Identifier: Apache-2.0
#include "accuracy/icp.hpp"

#include <pcl/console/print.h>
#include <pcl/registration/icp.h>

namespace locus {
namespace {

pcl::PointCloud<pcl::PointXYZ>::Ptr cloud_of(std::span<const Eigen::Vector3f> points) {
  auto cloud = pcl::make_shared<pcl::PointCloud<pcl::PointXYZ>>();
  cloud->reserve(points.size());
  for (const Eigen::Vector3f& point : points)
    cloud->emplace_back(point.x(), point.y(), point.z());
  return cloud;
}

} // namespace

Pose icp(std::span<const Eigen::Vector3f> source, std::span<const Eigen::Vector3f> target, double reach_m) {
  pcl::console::setVerbosityLevel(pcl::console::L_ALWAYS); // else it prints to the user that it found no pairs
  pcl::IterativeClosestPoint<pcl::PointXYZ, pcl::PointXYZ> matcher;
  matcher.setInputSource(cloud_of(source));
  matcher.setInputTarget(cloud_of(target));
  matcher.setMaxCorrespondenceDistance(reach_m);
  matcher.setMaximumIterations(100);
  matcher.setEuclideanFitnessEpsilon(1e-6); // relative change of the mean squared error
  pcl::PointCloud<pcl::PointXYZ> moved;
  matcher.align(moved);
  if (!matcher.hasConverged())
    return {};
  const Eigen::Matrix4d T = matcher.getFinalTransformation().cast<double>();
  return {Eigen::Quaterniond{Eigen::Matrix3d{T.topLeftCorner<3, 3>()}}.normalized(), T.topRightCorner<3, 1>()};
}

} // namespace locus
