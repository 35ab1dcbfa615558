// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

#include "ros_types.h"

/// Short names of the ROS 2 messages. They are C structs: strings and sequences are non-owning pointers.
namespace locus::daemon::ros {

using Time = builtin_interfaces_msg_dds__Time_;
using Header = std_msgs_msg_dds__Header_;
using Bool = std_msgs_msg_dds__Bool_;
using UInt8 = std_msgs_msg_dds__UInt8_;
using Point = geometry_msgs_msg_dds__Point_;
using Vector3 = geometry_msgs_msg_dds__Vector3_;
using Quaternion = geometry_msgs_msg_dds__Quaternion_;
using TransformStamped = geometry_msgs_msg_dds__TransformStamped_;
using Odometry = nav_msgs_msg_dds__Odometry_;
using TFMessage = tf2_msgs_msg_dds__TFMessage_;
using Imu = sensor_msgs_msg_dds__Imu_;
using PointField = sensor_msgs_msg_dds__PointField_;
using PointCloud2 = sensor_msgs_msg_dds__PointCloud2_;
using LivoxPoint = livox_ros_driver2_msg_dds__CustomPoint_;
using LivoxCloud = livox_ros_driver2_msg_dds__CustomMsg_;
using KeyValue = diagnostic_msgs_msg_dds__KeyValue_;
using DiagnosticStatus = diagnostic_msgs_msg_dds__DiagnosticStatus_;
using DiagnosticArray = diagnostic_msgs_msg_dds__DiagnosticArray_;
using Clock = rosgraph_msgs_msg_dds__Clock_;
using ParticipantEntitiesInfo = rmw_dds_common_msg_dds__ParticipantEntitiesInfo_;
using HumbleParticipantEntitiesInfo = rmw_dds_common_humble_dds__ParticipantEntitiesInfo_;

/// Type of a message for DDS and ROS 2. The hash is ROS 2's hash of the type description (REP 2016), expected in the
/// user data of every endpoint from Iron on. A type that ended with Humble has none.
struct Type {
  const dds_topic_descriptor_t* descriptor;
  std::string_view hash;
};

template <class Message> Type type_of();
template <> inline Type type_of<Bool>() {
  return {&std_msgs_msg_dds__Bool__desc, "feb91e995ff9ebd09c0cb3d2aed18b11077585839fb5db80193b62d74528f6c9"};
}
template <> inline Type type_of<UInt8>() {
  return {&std_msgs_msg_dds__UInt8__desc, "6138bd83d8c3569cb80a667db03cfc1629f529fee79d944c39c34e352e72f010"};
}
template <> inline Type type_of<Odometry>() {
  return {&nav_msgs_msg_dds__Odometry__desc, "3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0"};
}
template <> inline Type type_of<TFMessage>() {
  return {&tf2_msgs_msg_dds__TFMessage__desc, "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087"};
}
template <> inline Type type_of<Imu>() {
  return {&sensor_msgs_msg_dds__Imu__desc, "7d9a00ff131080897a5ec7e26e315954b8eae3353c3f995c55faf71574000b5b"};
}
template <> inline Type type_of<PointCloud2>() {
  return {&sensor_msgs_msg_dds__PointCloud2__desc, "9198cabf7da3796ae6fe19c4cb3bdd3525492988c70522628af5daa124bae2b5"};
}
template <> inline Type type_of<LivoxCloud>() {
  return {&livox_ros_driver2_msg_dds__CustomMsg__desc,
          "2eb17e5e35bf5a2d6cd079f3c57f33abf95e5bf7d71b42cddc05daace73d815a"};
}
template <> inline Type type_of<DiagnosticArray>() {
  return {&diagnostic_msgs_msg_dds__DiagnosticArray__desc,
          "5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e"};
}
template <> inline Type type_of<Clock>() {
  return {&rosgraph_msgs_msg_dds__Clock__desc, "692f7a66e93a3c83e71765d033b60349ba68023a8c689a79e48078bcb5c58564"};
}
template <> inline Type type_of<ParticipantEntitiesInfo>() {
  return {&rmw_dds_common_msg_dds__ParticipantEntitiesInfo__desc,
          "91a0593bacdcc50ea9bdcf849a938b128412cc1ea821245c663bcd26f83c295e"};
}
template <> inline Type type_of<HumbleParticipantEntitiesInfo>() {
  static const dds_topic_descriptor_t descriptor = [] {
    dds_topic_descriptor_t same_name = rmw_dds_common_humble_dds__ParticipantEntitiesInfo__desc;
    same_name.m_typename = rmw_dds_common_msg_dds__ParticipantEntitiesInfo__desc.m_typename;
    return same_name;
  }();
  return {&descriptor, ""};
}

} // namespace locus::daemon::ros
