// SPDX-License-Identifier: Apache-2.0
#include "daemon/dds/cloud_reader.hpp"

namespace locus::daemon {

namespace {

/// Returns the type of the clouds, as of read_cloud(), that a DDS type carries; empty if it carries none.
std::string_view cloud_type_of(std::string_view dds_type) {
  if (dds_type == ros::type_of<ros::PointCloud2>().descriptor->m_typename)
    return kPointCloudType;
  if (dds_type == ros::type_of<ros::LivoxCloud>().descriptor->m_typename)
    return kLivoxCloudType;
  return {};
}

} // namespace

bool CloudReader::carries_clouds(std::string_view dds_type) { return !cloud_type_of(dds_type).empty(); }

CloudReader::CloudReader(const DdsNode& node, const std::string& topic, TopicQos qos)
    : topic_(topic), qos_(qos), type_(kPointCloudType), discovered_type_(type_),
      reader_(DdsReader<ros::PointCloud2>(node, topic, qos)) {}

void CloudReader::discover(const std::string& topic, std::string_view dds_type) {
  if (topic == topic_ && carries_clouds(dds_type))
    discovered_type_ = cloud_type_of(dds_type);
}

bool CloudReader::follow(const DdsNode& node) {
  if (discovered_type_ == type_ || writers() > 0)
    return false;
  type_ = discovered_type_;
  if (is_livox_type(type_))
    reader_ = DdsReader<ros::LivoxCloud>(node, topic_, qos_);
  else
    reader_ = DdsReader<ros::PointCloud2>(node, topic_, qos_);
  return true;
}

} // namespace locus::daemon
