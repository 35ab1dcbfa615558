// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <type_traits>
#include <vector>

#include <fastcdr/Cdr.h>
#include <fastcdr/FastBuffer.h>
#include <fastdds/dds/topic/TopicDataType.hpp>

/// ROS 2's messages for Fast DDS, written independently from their definitions, so that the encoding shares nothing
/// with the one under test. Each struct passes its members in order to `fields`.
namespace locus::test {

struct FastHeader {
  std::int32_t sec = 0;
  std::uint32_t nanosec = 0;
  std::string frame_id;
  template <class Stream> void fields(Stream& s) { s(sec)(nanosec)(frame_id); }
};

struct FastPose {
  std::array<double, 7> xyz_xyzw{};
  template <class Stream> void fields(Stream& s) { s(xyz_xyzw); }
};

struct FastOdometry {
  static constexpr const char* kName = "nav_msgs::msg::dds_::Odometry_";
  FastHeader header;
  std::string child_frame_id;
  FastPose pose;
  std::array<double, 36> pose_covariance{};
  std::array<double, 6> twist{};
  std::array<double, 36> twist_covariance{};
  template <class Stream> void fields(Stream& s) {
    s(header)(child_frame_id)(pose)(pose_covariance)(twist)(twist_covariance);
  }
};

struct FastImu {
  static constexpr const char* kName = "sensor_msgs::msg::dds_::Imu_";
  FastHeader header;
  std::array<double, 4> orientation_xyzw{};
  std::array<double, 9> orientation_covariance{};
  std::array<double, 3> angular_velocity{};
  std::array<double, 9> angular_velocity_covariance{};
  std::array<double, 3> linear_acceleration{};
  std::array<double, 9> linear_acceleration_covariance{};
  template <class Stream> void fields(Stream& s) {
    s(header)(orientation_xyzw)(orientation_covariance)(angular_velocity)(angular_velocity_covariance);
    s(linear_acceleration)(linear_acceleration_covariance);
  }
};

struct FastUInt8 {
  static constexpr const char* kName = "std_msgs::msg::dds_::UInt8_";
  std::uint8_t data = 0;
  template <class Stream> void fields(Stream& s) { s(data); }
};

struct FastBool {
  static constexpr const char* kName = "std_msgs::msg::dds_::Bool_";
  bool data = false;
  template <class Stream> void fields(Stream& s) { s(data); }
};

struct FastTransformStamped {
  FastHeader header;
  std::string child_frame_id;
  FastPose transform;
  template <class Stream> void fields(Stream& s) { s(header)(child_frame_id)(transform); }
};

struct FastTransforms {
  static constexpr const char* kName = "tf2_msgs::msg::dds_::TFMessage_";
  std::vector<FastTransformStamped> transforms;
  template <class Stream> void fields(Stream& s) { s(transforms); }
};

struct FastPointField {
  std::string name;
  std::uint32_t offset = 0;
  std::uint8_t datatype = 0;
  std::uint32_t count = 0;
  template <class Stream> void fields(Stream& s) { s(name)(offset)(datatype)(count); }
};

struct FastCloud {
  static constexpr const char* kName = "sensor_msgs::msg::dds_::PointCloud2_";
  FastHeader header;
  std::uint32_t height = 0, width = 0;
  std::vector<FastPointField> point_fields;
  bool is_bigendian = false;
  std::uint32_t point_step = 0, row_step = 0;
  std::vector<std::uint8_t> data;
  bool is_dense = false;
  template <class Stream> void fields(Stream& s) {
    s(header)(height)(width)(point_fields)(is_bigendian)(point_step)(row_step)(data)(is_dense);
  }
};

struct FastLivoxPoint {
  std::uint32_t offset_time = 0;
  std::array<float, 3> xyz{};
  std::uint8_t reflectivity = 0, tag = 0, line = 0;
  template <class Stream> void fields(Stream& s) { s(offset_time)(xyz)(reflectivity)(tag)(line); }
};

struct FastLivoxCloud {
  static constexpr const char* kName = "livox_ros_driver2::msg::dds_::CustomMsg_";
  FastHeader header;
  std::uint64_t timebase = 0;
  std::uint32_t point_num = 0;
  std::uint8_t lidar_id = 0;
  std::array<std::uint8_t, 3> rsvd{};
  std::vector<FastLivoxPoint> points;
  template <class Stream> void fields(Stream& s) { s(header)(timebase)(point_num)(lidar_id)(rsvd)(points); }
};

struct FastKeyValue {
  std::string key, value;
  template <class Stream> void fields(Stream& s) { s(key)(value); }
};

struct FastDiagnosticStatus {
  std::uint8_t level = 0;
  std::string name, message, hardware_id;
  std::vector<FastKeyValue> values;
  template <class Stream> void fields(Stream& s) { s(level)(name)(message)(hardware_id)(values); }
};

struct FastDiagnostics {
  static constexpr const char* kName = "diagnostic_msgs::msg::dds_::DiagnosticArray_";
  FastHeader header;
  std::vector<FastDiagnosticStatus> statuses;
  template <class Stream> void fields(Stream& s) { s(header)(statuses); }
};

struct FastClock {
  static constexpr const char* kName = "rosgraph_msgs::msg::dds_::Clock_";
  std::int32_t sec = 0;
  std::uint32_t nanosec = 0;
  template <class Stream> void fields(Stream& s) { s(sec)(nanosec); }
};

/// 24 bytes up to Humble, 16 from then on.
template <std::size_t kBytes> struct FastGid {
  std::array<std::uint8_t, kBytes> data{};
  template <class Stream> void fields(Stream& s) { s(data); }
};

template <std::size_t kGidBytes> struct FastNode {
  std::string name_space, name;
  std::vector<FastGid<kGidBytes>> readers, writers;
  template <class Stream> void fields(Stream& s) { s(name_space)(name)(readers)(writers); }
};

template <std::size_t kGidBytes> struct FastParticipantEntities {
  static constexpr const char* kName = "rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_";
  FastGid<kGidBytes> gid;
  std::vector<FastNode<kGidBytes>> nodes;
  template <class Stream> void fields(Stream& s) { s(gid)(nodes); }
};

template <class T, class Stream>
concept HasFields = requires(T& value, Stream& stream) {
  value.fields(stream);
};

/// Writes or reads members with fastcdr.
template <bool kReads> class FastStream {
 public:
  explicit FastStream(eprosima::fastcdr::Cdr& cdr) : cdr_(cdr) {}

  template <class T> FastStream& operator()(T& value) {
    if constexpr (HasFields<T, FastStream>)
      value.fields(*this);
    else if constexpr (kReads)
      cdr_ >> value;
    else
      cdr_ << value;
    return *this;
  }
  template <class T>
  requires HasFields<T, FastStream> FastStream& operator()(std::vector<T>& values) {
    auto count = static_cast<std::uint32_t>(values.size());
    (*this)(count);
    values.resize(count);
    for (T& value : values)
      (*this)(value);
    return *this;
  }

 private:
  eprosima::fastcdr::Cdr& cdr_;
};

template <class Message> class FastType : public eprosima::fastdds::dds::TopicDataType {
 public:
  static constexpr std::uint32_t kMostBytes = std::is_same_v<Message, FastCloud> ? 1 << 22 : 1 << 20;
  using Payload = eprosima::fastrtps::rtps::SerializedPayload_t;

  FastType() {
    setName(Message::kName);
    m_typeSize = kMostBytes; // at most, of what the tests send NOLINT(cppcoreguidelines-prefer-member-initializer)
  }
  bool serialize(void* data, Payload* payload) override {
    eprosima::fastcdr::FastBuffer buffer(reinterpret_cast<char*>(payload->data), payload->max_size);
    eprosima::fastcdr::Cdr cdr(buffer, eprosima::fastcdr::Cdr::DEFAULT_ENDIAN, eprosima::fastcdr::Cdr::DDS_CDR);
    payload->encapsulation = CDR_LE;
    cdr.serialize_encapsulation();
    FastStream<false> stream(cdr);
    stream(*static_cast<Message*>(data));
    payload->length = static_cast<std::uint32_t>(cdr.getSerializedDataLength());
    return true;
  }
  bool deserialize(Payload* payload, void* data) override {
    try {
      eprosima::fastcdr::FastBuffer buffer(reinterpret_cast<char*>(payload->data), payload->length);
      eprosima::fastcdr::Cdr cdr(buffer, eprosima::fastcdr::Cdr::DEFAULT_ENDIAN, eprosima::fastcdr::Cdr::DDS_CDR);
      cdr.read_encapsulation();
      FastStream<true> stream(cdr);
      stream(*static_cast<Message*>(data));
      return true;
    } catch (const eprosima::fastcdr::exception::Exception&) {
      return false;
    }
  }
  std::function<std::uint32_t()> getSerializedSizeProvider(void*) override {
    return [this] { return m_typeSize; };
  }
  void* createData() override { return new Message; }                          // NOLINT: the library's way
  void deleteData(void* data) override { delete static_cast<Message*>(data); } // NOLINT
  bool getKey(void*, eprosima::fastrtps::rtps::InstanceHandle_t*, bool) override { return false; }
};

} // namespace locus::test
