// SPDX-License-Identifier: Apache-2.0
// REP 103 and REP 105: messages of the real service against the truth of the simulation.
#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include <Eigen/Eigenvalues>

#include "daemon/dds/dds_node.hpp"
#include "daemon/dds/ros_messages.hpp"
#include "service/robot_network.hpp"

namespace locus::test {
namespace {

using daemon::DdsNode;
using daemon::DdsReader;
using daemon::TopicQos;
using std::chrono::milliseconds;
using std::chrono::seconds;
namespace ros = daemon::ros;

/// A pose as published, and both frame ids of the message.
struct HeardFrames {
  std::string frame, child;
  Stamp stamp;
  Eigen::Quaterniond rotation;
  Eigen::Vector3d translation;
  [[nodiscard]] Pose pose() const { return {rotation.normalized(), translation}; }
};
struct HeardOdometry : HeardFrames {
  Eigen::Vector3d linear, angular;
  Matrix6 pose_covariance, twist_covariance;
};
struct HeardCloud {
  std::string frame;
  Stamp stamp;
  std::vector<Eigen::Vector3d> points;
};

Eigen::Vector3d vector_of(const auto& v) { return {v.x_, v.y_, v.z_}; }
Eigen::Quaterniond rotation_of(const ros::Quaternion& q) { return {q.w_, q.x_, q.y_, q.z_}; }
Matrix6 covariance_of(const double* row_major) {
  return Eigen::Map<const Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(row_major);
}

/// Subscribes to all topics of the service.
class Listener {
 public:
  explicit Listener(const DdsNode& node)
      : odometry_reader_(node, "/locus/odometry", TopicQos::standard()),
        fast_reader_(node, "/locus/odometry_fast", TopicQos::standard()),
        tf_reader_(node, "/tf", TopicQos::transform()), cloud_reader_(node, "/locus/cloud", TopicQos::standard()),
        diagnostics_reader_(node, "/diagnostics", TopicQos::standard()),
        thread_([this](const std::stop_token& stop) { hear(stop); }) {}

  /// Returns whether all topics are received from now on: the service discovers readers in the order of their creation.
  bool hears_the_service() {
    return comes_true([this] {
      return odometry_reader_.writers() > 0 && fast_reader_.writers() > 0 && tf_reader_.writers() > 0 &&
             cloud_reader_.writers() > 0 && diagnosed_;
    });
  }

  void end() {
    thread_.request_stop();
    thread_.join();
  }

  std::vector<HeardOdometry> odometry, fast;
  std::vector<HeardFrames> tf;
  std::vector<HeardCloud> clouds;

 private:
  static HeardOdometry odometry_of(const ros::Odometry& m) {
    return {{m.header_.frame_id_, m.child_frame_id_, daemon::to_stamp(m.header_.stamp_),
             rotation_of(m.pose_.pose_.orientation_), vector_of(m.pose_.pose_.position_)},
            vector_of(m.twist_.twist_.linear_),
            vector_of(m.twist_.twist_.angular_),
            covariance_of(m.pose_.covariance_),
            covariance_of(m.twist_.covariance_)};
  }
  static HeardFrames frames_of(const ros::TransformStamped& m) {
    return {m.header_.frame_id_, m.child_frame_id_, daemon::to_stamp(m.header_.stamp_),
            rotation_of(m.transform_.rotation_), vector_of(m.transform_.translation_)};
  }
  static HeardCloud cloud_of(const ros::PointCloud2& m) {
    HeardCloud cloud{m.header_.frame_id_, daemon::to_stamp(m.header_.stamp_), {}};
    for (std::uint32_t i = 0; i < m.width_; ++i) {
      std::array<float, 3> xyz{}; // the first three fields
      std::copy_n(m.data_._buffer + std::size_t{i} * m.point_step_, sizeof(xyz), reinterpret_cast<std::uint8_t*>(&xyz));
      cloud.points.emplace_back(xyz[0], xyz[1], xyz[2]);
    }
    return cloud;
  }

  void hear(const std::stop_token& stop) {
    while (!stop.stop_requested()) {
      odometry_reader_.take([this](const ros::Odometry& m) { odometry.push_back(odometry_of(m)); });
      fast_reader_.take([this](const ros::Odometry& m) { fast.push_back(odometry_of(m)); });
      tf_reader_.take([this](const ros::TFMessage& m) {
        for (std::uint32_t i = 0; i < m.transforms_._length; ++i)
          tf.push_back(frames_of(m.transforms_._buffer[i]));
      });
      cloud_reader_.take([this](const ros::PointCloud2& m) { clouds.push_back(cloud_of(m)); });
      diagnostics_reader_.take([this](const ros::DiagnosticArray& /*m*/) { diagnosed_ = true; });
      std::this_thread::sleep_for(milliseconds{2});
    }
  }

  DdsReader<ros::Odometry> odometry_reader_, fast_reader_;
  DdsReader<ros::TFMessage> tf_reader_;
  DdsReader<ros::PointCloud2> cloud_reader_;
  DdsReader<ros::DiagnosticArray> diagnostics_reader_;
  std::atomic<bool> diagnosed_{false};
  std::jthread thread_; ///< receives until stopped
};

/// The simulated drive: left-hand laps around a room with walls at x = +-5 m and y = +-4 m.
class Truth {
 public:
  explicit Truth(const std::filesystem::path& file) : poses_(read_tum(file)) {}

  [[nodiscard]] const Pose& start() const { return poses_.front().T_source_base; }
  [[nodiscard]] std::optional<Pose> at(Stamp stamp) const {
    const auto after = std::ranges::lower_bound(poses_, stamp, {}, &StampedPose::stamp);
    if (after == poses_.begin() || after == poses_.end())
      return std::nullopt;
    const StampedPose& before = *std::prev(after);
    return interpolate(before.T_source_base, after->T_source_base,
                       to_seconds(stamp - before.stamp) / to_seconds(after->stamp - before.stamp));
  }

  struct Motion {
    Eigen::Vector3d linear, angular; ///< body frame
  };
  /// Returns the motion if it is uniform from 0.25 s before this instant to 0.1 s after it.
  [[nodiscard]] std::optional<Motion> even_motion(Stamp stamp) const {
    std::optional<Motion> first;
    for (Duration offset = milliseconds{-250}; offset < milliseconds{100}; offset += milliseconds{50}) {
      const auto from = at(stamp + offset), to = at(stamp + offset + milliseconds{50});
      if (!from || !to)
        return std::nullopt;
      const Pose step = from->inverse() * *to;
      const Eigen::AngleAxisd turn(step.rotation);
      const Motion motion{from->rotation.inverse() * (to->translation - from->translation) / 0.05,
                          turn.axis() * turn.angle() / 0.05};
      if (!first)
        first = motion;
      if ((motion.linear - first->linear).norm() > 0.2 || (motion.angular - first->angular).norm() > 0.1)
        return std::nullopt;
    }
    return first;
  }

 private:
  std::vector<StampedPose> poses_;
};

class Frames : public RobotNetwork {};

void expect_names_and_order(const auto& heard, const std::string& what) {
  ASSERT_GT(heard.size(), 100U) << what;
  for (std::size_t i = 0; i < heard.size(); ++i) {
    EXPECT_EQ(heard[i].frame + " " + heard[i].child, "odom base_link") << what;
    EXPECT_NEAR(heard[i].rotation.norm(), 1.0, 1e-9) << what;
    EXPECT_TRUE(i == 0 || heard[i].stamp > heard[i - 1].stamp) << what << " " << i;
  }
}

/// Metres, radians, x forward, y left, z up, relative to the robot's start.
void expect_true_poses(const std::vector<HeardOdometry>& heard, const Truth& truth, Duration shift) {
  int compared = 0;
  for (const HeardOdometry& one : heard)
    if (const auto T_world_base = truth.at(one.stamp - shift)) {
      const Pose error = (truth.start().inverse() * *T_world_base).inverse() * one.pose();
      EXPECT_LT(error.translation.norm(), 0.1);
      EXPECT_LT(angle_rad(error.rotation), 2 * kRadPerDeg);
      ++compared;
    }
  EXPECT_GT(compared, 150);
}

/// REP 105: the pose is continuous, within 1 m/s and 2 rad/s.
void expect_continuous(const std::vector<HeardOdometry>& heard) {
  for (std::size_t i = 1; i < heard.size(); ++i) {
    const Pose step = heard[i - 1].pose().inverse() * heard[i].pose();
    const double elapsed_s = to_seconds(heard[i].stamp - heard[i - 1].stamp);
    EXPECT_LT(step.translation.norm(), 1.0 * elapsed_s + 0.05);
    EXPECT_LT(angle_rad(step.rotation), 2.0 * elapsed_s + 0.05);
  }
}

/// The twist is in the child frame: forward is +x at any heading, and a left turn is +z.
void expect_true_twists(const std::vector<HeardOdometry>& heard, const Truth& truth, Duration shift) {
  std::set<int> headings; // quadrants
  int turning = 0;
  for (const HeardOdometry& one : heard) {
    const auto motion = truth.even_motion(one.stamp - shift);
    if (!motion)
      continue;
    EXPECT_NEAR(one.linear.x(), motion->linear.x(), 0.2);
    EXPECT_NEAR(one.linear.y(), 0, 0.2);
    EXPECT_NEAR(one.linear.z(), 0, 0.1);
    EXPECT_NEAR(one.angular.z(), motion->angular.z(), 0.2);
    EXPECT_NEAR(one.angular.head<2>().norm(), 0, 0.1);
    if (motion->angular.z() > 1.0)
      ++turning;
    const Eigen::Vector3d forward = one.rotation * Eigen::Vector3d::UnitX();
    const double yaw_deg = std::atan2(forward.y(), forward.x()) / kRadPerDeg;
    if (one.linear.x() > 0.5)
      headings.insert(static_cast<int>(std::lround(yaw_deg / 90.0) + 4) % 4);
  }
  EXPECT_EQ(headings.size(), 4U) << "it drives forward in all four directions";
  EXPECT_GT(turning, 5);
}

void expect_covariances(const std::vector<HeardOdometry>& heard) {
  for (const HeardOdometry& one : heard)
    for (const Matrix6& covariance : {one.pose_covariance, one.twist_covariance}) {
      ASSERT_TRUE(covariance.allFinite());
      EXPECT_LT((covariance - covariance.transpose()).norm(), 1e-9 * covariance.norm());
      EXPECT_GT(covariance.diagonal().minCoeff(), 0.0) << "no axis is known exactly, nor unknown to an EKF";
      EXPECT_GE(covariance.selfadjointView<Eigen::Lower>().eigenvalues().minCoeff(), -1e-9 * covariance.norm());
    }
}

const HeardOdometry* same_time(const std::vector<HeardOdometry>& heard, Stamp stamp) {
  const auto found = std::ranges::find(heard, stamp, &HeardOdometry::stamp);
  return found == heard.end() ? nullptr : &*found;
}

void expect_transforms_of(const std::vector<HeardOdometry>& odometry, const std::vector<HeardFrames>& transforms) {
  EXPECT_NEAR(static_cast<double>(transforms.size()), static_cast<double>(odometry.size()), 2.0);
  for (const HeardFrames& transform : transforms)
    if (const HeardOdometry* const one = same_time(odometry, transform.stamp)) {
      EXPECT_EQ(transform.translation, one->translation);
      EXPECT_EQ(transform.rotation.coeffs(), one->rotation.coeffs());
    } else {
      ADD_FAILURE() << "a transform of a time without odometry";
    }
}

/// Points in the base frame lie on the room once transformed by the pose.
void expect_clouds_in_the_room(const std::vector<HeardCloud>& clouds, const std::vector<HeardOdometry>& odometry,
                               const Truth& truth, Duration shift) {
  constexpr double kTolerance_m = 0.2;
  EXPECT_GT(clouds.size(), 100U);
  const Eigen::Vector3d margin = Eigen::Vector3d::Constant(kTolerance_m), low{-5, -4, 0}, high{5, 4, 4};
  const Eigen::AlignedBox3d room(low - margin, high + margin);
  for (const HeardCloud& cloud : clouds) {
    EXPECT_EQ(cloud.frame, "base_link");
    const HeardOdometry* const at = same_time(odometry, cloud.stamp);
    if (at == nullptr || !truth.at(cloud.stamp - shift)) // the lidar is switched off by then
      continue;
    const Pose T_world_base = truth.start() * at->pose();
    const auto inside = std::ranges::count_if(cloud.points, [&](const Eigen::Vector3d& p) {
      return room.contains(Eigen::Vector3d(T_world_base.rotation * p + T_world_base.translation));
    });
    const auto on_the_floor = std::ranges::count_if(cloud.points, [](const auto& p) { return std::abs(p.z()) < 0.05; });
    EXPECT_GT(static_cast<double>(inside), 0.99 * static_cast<double>(cloud.points.size()));
    EXPECT_GT(on_the_floor, 50) << "of " << cloud.points.size();
  }
}

TEST_F(Frames, OfADriveFollowRep103AndRep105) {
  const Truth truth(capture() / "gt.tum");
  const Child daemon(led_locusd(config("dds: {publish_tf: true, publish_cloud: true}\n")));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  const auto node = DdsNode::open({});
  ASSERT_TRUE(node) << node.error();
  Listener listener(*node);
  ASSERT_TRUE(listener.hears_the_service());
  Child play(leading_play({capture().string()}));
  ASSERT_EQ(play.wait_for_exit(patience_of_a_drive()), 0) << testing::PrintToString(play.lines());
  std::this_thread::sleep_for(milliseconds{500});
  listener.end();

  expect_names_and_order(listener.odometry, "odometry");
  expect_names_and_order(listener.fast, "odometry_fast");
  expect_names_and_order(listener.tf, "tf");
  const Duration shift = shift_of(play);
  expect_true_poses(listener.odometry, truth, shift);
  expect_true_poses(listener.fast, truth, shift);
  expect_continuous(listener.odometry);
  expect_true_twists(listener.odometry, truth, shift);
  expect_covariances(listener.odometry);
  expect_transforms_of(listener.odometry, listener.tf);
  expect_clouds_in_the_room(listener.clouds, listener.odometry, truth, shift);
}

} // namespace
} // namespace locus::test
