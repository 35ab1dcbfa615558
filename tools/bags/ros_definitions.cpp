// SPDX-License-Identifier: Apache-2.0
#include "bags/ros_definitions.hpp"

#include <algorithm>
#include <array>
#include <vector>

namespace locus::tools {
namespace {

/// Definition as in ROS 2, without its comments.
struct Definition {
  std::string_view name; ///< without /msg
  std::string_view fields;
};

constexpr std::array kDefinitions{
    Definition{"builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n"},
    Definition{"std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id\n"},
    Definition{"std_msgs/String", "string data\n"},
    Definition{"nebula_msgs/NebulaPacket", "builtin_interfaces/Time stamp\nuint8[] data\n"},
    Definition{"nebula_msgs/NebulaPackets", "std_msgs/Header header\nnebula_msgs/NebulaPacket[] packets\n"},
    Definition{"ouster_sensor_msgs/PacketMsg", "uint8[] buf\n"},
    Definition{"geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z\n"},
    Definition{"geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z\n"},
    Definition{"geometry_msgs/Quaternion", "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n"},
    Definition{"geometry_msgs/Pose", "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n"},
    Definition{"geometry_msgs/PoseWithCovariance", "geometry_msgs/Pose pose\nfloat64[36] covariance\n"},
    Definition{"geometry_msgs/Twist", "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n"},
    Definition{"geometry_msgs/TwistWithCovariance", "geometry_msgs/Twist twist\nfloat64[36] covariance\n"},
    Definition{"geometry_msgs/Transform", "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n"},
    Definition{"geometry_msgs/TransformStamped",
               "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n"},
    Definition{"nav_msgs/Odometry", "std_msgs/Header header\nstring child_frame_id\n"
                                    "geometry_msgs/PoseWithCovariance pose\ngeometry_msgs/TwistWithCovariance twist\n"},
    Definition{"tf2_msgs/TFMessage", "geometry_msgs/TransformStamped[] transforms\n"},
    Definition{"sensor_msgs/Imu",
               "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n"
               "geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n"
               "geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance\n"},
    Definition{"sensor_msgs/PointField",
               "uint8 INT8=1\nuint8 UINT8=2\nuint8 INT16=3\nuint8 UINT16=4\nuint8 INT32=5\nuint8 UINT32=6\n"
               "uint8 FLOAT32=7\nuint8 FLOAT64=8\nstring name\nuint32 offset\nuint8 datatype\nuint32 count\n"},
    Definition{"sensor_msgs/PointCloud2",
               "std_msgs/Header header\nuint32 height\nuint32 width\nsensor_msgs/PointField[] fields\n"
               "bool is_bigendian\nuint32 point_step\nuint32 row_step\nuint8[] data\nbool is_dense\n"},
    Definition{"diagnostic_msgs/KeyValue", "string key\nstring value\n"},
    Definition{"diagnostic_msgs/DiagnosticStatus",
               "byte OK=0\nbyte WARN=1\nbyte ERROR=2\nbyte STALE=3\nbyte level\nstring name\nstring message\n"
               "string hardware_id\ndiagnostic_msgs/KeyValue[] values\n"},
    Definition{"diagnostic_msgs/DiagnosticArray",
               "std_msgs/Header header\ndiagnostic_msgs/DiagnosticStatus[] status\n"},
};

/// Adds the definitions of the fields' types, recursively, each once.
void add_needed(std::string_view fields, std::vector<const Definition*>& needed) {
  for (const Definition& definition : kDefinitions) {
    const bool is_named = fields.find(std::string(definition.name) + ' ') != std::string_view::npos ||
                          fields.find(std::string(definition.name) + '[') != std::string_view::npos;
    if (!is_named || std::ranges::find(needed, &definition) != needed.end())
      continue;
    needed.push_back(&definition);
    add_needed(definition.fields, needed);
  }
}

} // namespace

std::string ros2_definition(std::string_view type) {
  std::string name(type);
  name.erase(name.find("/msg"), 4);
  const auto* const found = std::ranges::find(kDefinitions, name, &Definition::name);
  std::string text(found->fields);
  std::vector<const Definition*> needed;
  add_needed(found->fields, needed);
  for (const Definition* definition : needed) {
    text += std::string(80, '=') + "\nMSG: ";
    text += definition->name;
    text += '\n';
    text += definition->fields;
  }
  return text;
}

} // namespace locus::tools
