// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "core/sources/motion_sample.hpp"
#include "daemon/dds/ros_messages.hpp"

namespace locus::tools {

/// Converts a sample to the message of a driver. `frame` must outlive the message.
daemon::ros::Imu to_ros(const ImuSample& sample, const std::string& frame);

/// Converts a sample to a driver's odometry, with a covariance in the proportion that the sample has to usual ones.
/// `frames` must outlive the message.
daemon::ros::Odometry to_ros(const OdometrySample& sample, const daemon::FrameNames& frames);

} // namespace locus::tools
