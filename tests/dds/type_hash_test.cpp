// SPDX-License-Identifier: Apache-2.0
// Hashes of ROS 2's types (RIHS01, REP 2016), computed from the message definitions as rosidl does, independent of the
// table in the code.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <map>
#include <memory>
#include <set>
#include <sstream>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "daemon/dds/dds_node.hpp"
#include "daemon/dds/ros_link.hpp"
#include "support/child.hpp"
#include "support/dds_domain.hpp"
#include "support/temporary_file.hpp"

namespace locus::daemon {
namespace {

/// All published and subscribed messages and their parts: the .msg files of Jazzy without comments and constants. A
/// char of a .msg file is a uint8.
const std::map<std::string, std::string> kDefinitions{
    {"builtin_interfaces/msg/Time", "int32 sec, uint32 nanosec"},
    {"std_msgs/msg/Header", "builtin_interfaces/msg/Time stamp, string frame_id"},
    {"std_msgs/msg/Bool", "bool data"},
    {"std_msgs/msg/UInt8", "uint8 data"},
    {"geometry_msgs/msg/Point", "float64 x, float64 y, float64 z"},
    {"geometry_msgs/msg/Vector3", "float64 x, float64 y, float64 z"},
    {"geometry_msgs/msg/Quaternion", "float64 x, float64 y, float64 z, float64 w"},
    {"geometry_msgs/msg/Pose", "geometry_msgs/msg/Point position, geometry_msgs/msg/Quaternion orientation"},
    {"geometry_msgs/msg/PoseWithCovariance", "geometry_msgs/msg/Pose pose, float64[36] covariance"},
    {"geometry_msgs/msg/Twist", "geometry_msgs/msg/Vector3 linear, geometry_msgs/msg/Vector3 angular"},
    {"geometry_msgs/msg/TwistWithCovariance", "geometry_msgs/msg/Twist twist, float64[36] covariance"},
    {"geometry_msgs/msg/Transform", "geometry_msgs/msg/Vector3 translation, geometry_msgs/msg/Quaternion rotation"},
    {"geometry_msgs/msg/TransformStamped",
     "std_msgs/msg/Header header, string child_frame_id, geometry_msgs/msg/Transform transform"},
    {"nav_msgs/msg/Odometry", "std_msgs/msg/Header header, string child_frame_id, geometry_msgs/msg/PoseWithCovariance "
                              "pose, geometry_msgs/msg/TwistWithCovariance twist"},
    {"tf2_msgs/msg/TFMessage", "geometry_msgs/msg/TransformStamped[] transforms"},
    {"sensor_msgs/msg/Imu",
     "std_msgs/msg/Header header, geometry_msgs/msg/Quaternion orientation, float64[9] orientation_covariance, "
     "geometry_msgs/msg/Vector3 angular_velocity, float64[9] angular_velocity_covariance, "
     "geometry_msgs/msg/Vector3 linear_acceleration, float64[9] linear_acceleration_covariance"},
    {"sensor_msgs/msg/PointField", "string name, uint32 offset, uint8 datatype, uint32 count"},
    {"sensor_msgs/msg/PointCloud2",
     "std_msgs/msg/Header header, uint32 height, uint32 width, sensor_msgs/msg/PointField[] fields, bool is_bigendian, "
     "uint32 point_step, uint32 row_step, uint8[] data, bool is_dense"},
    {"livox_ros_driver2/msg/CustomPoint",
     "uint32 offset_time, float32 x, float32 y, float32 z, uint8 reflectivity, uint8 tag, uint8 line"},
    {"livox_ros_driver2/msg/CustomMsg",
     "std_msgs/msg/Header header, uint64 timebase, uint32 point_num, uint8 lidar_id, uint8[3] rsvd, "
     "livox_ros_driver2/msg/CustomPoint[] points"},
    {"diagnostic_msgs/msg/KeyValue", "string key, string value"},
    {"diagnostic_msgs/msg/DiagnosticStatus",
     "byte level, string name, string message, string hardware_id, diagnostic_msgs/msg/KeyValue[] values"},
    {"diagnostic_msgs/msg/DiagnosticArray",
     "std_msgs/msg/Header header, diagnostic_msgs/msg/DiagnosticStatus[] status"},
    {"rosgraph_msgs/msg/Clock", "builtin_interfaces/msg/Time clock"},
    {"rmw_dds_common/msg/Gid", "char[16] data"},
    {"rmw_dds_common/msg/NodeEntitiesInfo",
     "string<=256 node_namespace, string<=256 node_name, rmw_dds_common/msg/Gid[] reader_gid_seq, "
     "rmw_dds_common/msg/Gid[] writer_gid_seq"},
    {"rmw_dds_common/msg/ParticipantEntitiesInfo",
     "rmw_dds_common/msg/Gid gid, rmw_dds_common/msg/NodeEntitiesInfo[] node_entities_info_seq"}};

/// Numbers of type_description_interfaces/msg/FieldType; arrays are offset by 48, sequences by 144.
const std::map<std::string, int> kTypeIds{{"uint8", 3},  {"char", 3},     {"int32", 6},    {"uint32", 7},
                                          {"uint64", 9}, {"float32", 10}, {"float64", 11}, {"bool", 15},
                                          {"byte", 16},  {"string", 17}};
constexpr int kNestedType = 1, kBoundedString = 21, kArray = 48, kSequence = 144;

struct Field {
  std::string name, nested;
  int type_id = 0, capacity = 0, string_capacity = 0;
};

Field parse_field(const std::string& text) {
  Field field;
  std::string type;
  std::istringstream(text) >> type >> field.name;
  int more = 0;
  if (const std::size_t bracket = type.find('['); bracket != std::string::npos) {
    const std::string count = type.substr(bracket + 1, type.size() - bracket - 2);
    more = count.empty() ? kSequence : kArray;
    field.capacity = count.empty() ? 0 : std::stoi(count);
    type.resize(bracket);
  }
  if (const std::size_t bound = type.find("<="); bound != std::string::npos) {
    field.string_capacity = std::stoi(type.substr(bound + 2));
    field.type_id = kBoundedString;
  } else if (type.find('/') != std::string::npos) {
    field.nested = type;
    field.type_id = kNestedType;
  } else {
    field.type_id = kTypeIds.at(type);
  }
  field.type_id += more;
  return field;
}

std::vector<Field> fields_of(const std::string& type) {
  std::istringstream definition(kDefinitions.at(type));
  std::vector<Field> fields;
  for (std::string text; std::getline(definition, text, ',');)
    fields.push_back(parse_field(text));
  return fields;
}

void find_nested(const std::string& type, std::set<std::string>& found) {
  for (const Field& field : fields_of(type))
    if (!field.nested.empty() && found.insert(field.nested).second)
      find_nested(field.nested, found);
}

std::string describe(const std::string& type) {
  std::vector<std::string> fields;
  for (const Field& field : fields_of(type))
    fields.push_back(fmt::format(R"({{"name": "{}", "type": {{"type_id": {}, "capacity": {}, "string_capacity": {}, )"
                                 R"("nested_type_name": "{}"}}}})",
                                 field.name, field.type_id, field.capacity, field.string_capacity, field.nested));
  return fmt::format(R"({{"type_name": "{}", "fields": [{}]}})", type, fmt::join(fields, ", "));
}

std::string sha256(const std::string& text) {
  const test::TemporaryFile file("description.json", test::bytes_of(text));
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> output{
      popen(("sha256sum " + file.path().string()).c_str(), "r"), &pclose};
  std::array<char, 65> digits{};
  EXPECT_NE(std::fgets(digits.data(), digits.size(), output.get()), nullptr);
  return digits.data();
}

std::string type_hash(const std::string& type) {
  std::set<std::string> nested;
  find_nested(type, nested);
  std::vector<std::string> references(nested.size());
  std::ranges::transform(nested, references.begin(), describe);
  return "RIHS01_" + sha256(fmt::format(R"({{"type_description": {}, "referenced_type_descriptions": [{}]}})",
                                        describe(type), fmt::join(references, ", ")));
}

/// Maps "nav_msgs::msg::dds_::Odometry_" to nav_msgs/msg/Odometry.
std::string ros_type(const std::string& dds_type) {
  const std::size_t package = dds_type.find("::"), name = dds_type.rfind("::") + 2;
  return dds_type.substr(0, package) + "/msg/" + dds_type.substr(name, dds_type.size() - name - 1);
}

/// Reference printed by ROS 2 itself for this type.
TEST(TypeHash, MatchesRos) {
  EXPECT_EQ(type_hash("std_msgs/msg/Header"),
            "RIHS01_f49fb3ae2cf070f793645ff749683ac6b06203e41c891e17701b1cb597ce6a01");
}

class DiscoveredTypes : public testing::TestWithParam<const char*> {
 protected:
  /// Waits for this number of endpoints, each of which must announce the hash of its type.
  void expect_hashes(std::size_t endpoints, const std::set<std::string>& types) const {
    const auto seen = [&](const std::vector<std::string>& lines) {
      const auto is_endpoint = [](const auto& line) {
        return line.starts_with("reader ") || line.starts_with("writer ");
      };
      return static_cast<std::size_t>(std::ranges::count_if(lines, is_endpoint)) >= endpoints;
    };
    ASSERT_TRUE(peer_.wait_until(seen)) << testing::PrintToString(peer_.lines());
    std::set<std::string> found;
    for (const char* kind : {"reader", "writer"})
      for (const std::string& line : peer_.lines_of(kind)) {
        std::string gid, topic, type, user_data;
        std::istringstream(line) >> gid >> topic >> type >> user_data;
        found.insert(ros_type(type));
        EXPECT_EQ(user_data, "typehash=" + type_hash(ros_type(type)) + ";") << line;
      }
    EXPECT_EQ(found, types);
  }

  /// Returns a participant of locusd in the peer's domain.
  [[nodiscard]] DdsNode node() const {
    DdsOptions options;
    options.domain = domain_.number();
    Expected<DdsNode, std::string> opened = DdsNode::open(options);
    if (!opened)
      throw std::runtime_error(opened.error());
    return std::move(*opened);
  }

  test::DdsDomain domain_;
  test::Child peer_{{GetParam(), std::to_string(domain_.number()), "iron", "/locus"}};
};

TEST_P(DiscoveredTypes, OfTheServiceHaveTheHashesOfRos) {
  Config config;
  config.dds.domain = domain_.number();
  config.dds.publish_tf = config.dds.publish_cloud = config.dds.publish_map = true;
  config.dds.flat_ground_topic = "/flat_ground";
  const RosLink link(config, [](const RosInput&) {});
  expect_hashes(13, {"nav_msgs/msg/Odometry", "std_msgs/msg/UInt8", "std_msgs/msg/Bool", "tf2_msgs/msg/TFMessage",
                     "sensor_msgs/msg/Imu", "sensor_msgs/msg/PointCloud2", "diagnostic_msgs/msg/DiagnosticArray",
                     "rmw_dds_common/msg/ParticipantEntitiesInfo"});
}

TEST_P(DiscoveredTypes, OfTheClockHaveTheHashOfRos) {
  const DdsNode participant = node();
  const DdsWriter<ros::Clock> clock{participant, "/clock", TopicQos::clock()};
  expect_hashes(1, {"rosgraph_msgs/msg/Clock"});
}

TEST_P(DiscoveredTypes, OfLivoxHasTheHashOfRos) {
  const DdsNode participant = node();
  const DdsReader<ros::LivoxCloud> clouds{participant, "/livox/lidar", TopicQos::cloud_in()};
  expect_hashes(1, {"livox_ros_driver2/msg/CustomMsg"});
}

INSTANTIATE_TEST_SUITE_P(Dds, DiscoveredTypes, testing::Values(CYCLONE_PEER, FAST_DDS_PEER), [](const auto& peer) {
  return std::string(peer.param).find("fast") == std::string::npos ? "Cyclone" : "FastDds";
});

} // namespace
} // namespace locus::daemon
