// SPDX-License-Identifier: Apache-2.0
// A participant of Fast DDS, ROS 2's default: fast_dds_peer DOMAIN listen|talk|iron|humble|clouds|livox PREFIX
// [ADDRESS]; iron and humble print the discovery of nodes and of DDS endpoints. Uses the loopback interface, or that of
// ADDRESS. A listener prints `matched TOPIC` once it knows a writer. See peer_words.hpp.
#include <atomic>
#include <cstdlib>
#include <deque>
#include <memory>
#include <stdexcept>

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/domain/DomainParticipantListener.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/Topic.hpp>
#include <fastdds/rtps/reader/ReaderDiscoveryInfo.h>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastdds/rtps/writer/WriterDiscoveryInfo.h>

#include "dds/fast_dds_types.hpp"
#include "dds/peer_words.hpp"
#include "dds/room_cloud.hpp"

namespace locus::test {
namespace {

namespace dds = eprosima::fastdds::dds;

constexpr auto kAsNeeded = eprosima::fastrtps::rtps::DYNAMIC_RESERVE_MEMORY_MODE; ///< not the maximum size of the type

/// Prints the endpoints of other participants.
class Discovery : public dds::DomainParticipantListener {
 public:
  void on_subscriber_discovery(dds::DomainParticipant* own,
                               eprosima::fastrtps::rtps::ReaderDiscoveryInfo&& reader) override {
    say("reader", *own, reader.info);
  }
  void on_publisher_discovery(dds::DomainParticipant* own,
                              eprosima::fastrtps::rtps::WriterDiscoveryInfo&& writer) override {
    say("writer", *own, writer.info);
  }

 private:
  template <class Endpoint>
  static void say(const char* kind, const dds::DomainParticipant& own, const Endpoint& endpoint) {
    const auto& guid = endpoint.guid();
    if (guid.guidPrefix == own.guid().guidPrefix)
      return;
    const auto& user_data = endpoint.m_qos.m_userData.data_vec();
    tell("{} {}{} {} {} {}", kind, hex(guid.guidPrefix.value), hex(guid.entityId.value),
         endpoint.topicName().to_string(), endpoint.typeName().to_string(),
         std::string(user_data.begin(), user_data.end()));
  }
};

dds::DomainParticipant* join(std::uint32_t domain, const std::string& address, dds::DomainParticipantListener* hears) {
  auto wire = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
  wire->interfaceWhiteList.push_back(address);
  dds::DomainParticipantQos qos;
  qos.transport().use_builtin_transports = false;
  qos.transport().user_transports.push_back(wire);
  dds::DomainParticipant* participant =
      dds::DomainParticipantFactory::get_instance()->create_participant(domain, qos, hears, dds::StatusMask::none());
  if (participant == nullptr)
    throw std::runtime_error("no participant");
  return participant;
}

template <class Message> dds::Topic* topic_of(dds::DomainParticipant& participant, const std::string& name) {
  dds::TypeSupport(new FastType<Message>).register_type(&participant); // NOLINT: TypeSupport owns it
  return participant.create_topic(name.front() == '/' ? "rt" + name : name, Message::kName, dds::TOPIC_QOS_DEFAULT);
}

void say(const FastOdometry& m, const char* topic) {
  const auto& p = m.pose.xyz_xyzw;
  tell("{} {}.{:09} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {} {} {:.9g} {:.9g} {}", topic, m.header.sec,
       m.header.nanosec, p[0], p[1], p[2], p[3], p[4], p[5], p[6], m.header.frame_id, m.child_frame_id,
       m.pose_covariance[35], m.twist[5], realtime_ns());
}
void say(const FastImu& m, const char* topic) {
  tell("{} {}.{:09} {}", topic, m.header.sec, m.header.nanosec, realtime_ns());
}
void say(const FastUInt8& m, const char* topic) { tell("{} {}", topic, m.data); }
void say(const FastTransforms& m, const char* topic) {
  for (const FastTransformStamped& t : m.transforms)
    tell("{} {} {} {:.9f}", topic, t.header.frame_id, t.child_frame_id, t.transform.xyz_xyzw[0]);
}
void say(const FastCloud& m, const char* topic) {
  tell("{} {} {} {} {} {}", topic, m.width, m.point_step, m.data.size(), m.point_fields.size(), m.header.frame_id);
}
void say(const FastDiagnostics& m, const char* topic) {
  for (const FastDiagnosticStatus& status : m.statuses)
    tell("{} {} {} {}", topic, status.level, status.values.size(), status.name);
}

void say(const FastClock& m, const char* topic) { tell("{} {}.{:09} {}", topic, m.sec, m.nanosec, realtime_ns()); }
template <std::size_t kGidBytes> void say(const FastParticipantEntities<kGidBytes>& m, const char* topic) {
  for (const FastNode<kGidBytes>& node : m.nodes) {
    tell("{} {} {} {}", topic, node.name_space, node.name, hex(m.gid.data));
    for (const auto& gid : node.readers)
      tell("{}_reader {}", topic, hex(gid.data));
    for (const auto& gid : node.writers)
      tell("{}_writer {}", topic, hex(gid.data));
    tell("{}_end {}", topic, node.name);
  }
}

template <class Message> class Listener : public dds::DataReaderListener {
 public:
  explicit Listener(std::string word) : word_(std::move(word)) {}
  void on_data_available(dds::DataReader* reader) override {
    Message message;
    dds::SampleInfo info;
    while (reader->take_next_sample(&message, &info) == ReturnCode_t::RETCODE_OK)
      if (info.valid_data)
        say(message, word_.c_str());
  }
  void on_subscription_matched(dds::DataReader* /*reader*/, const dds::SubscriptionMatchedStatus& status) override {
    if (status.current_count > 0 && !matched_.exchange(true))
      tell("matched {}", word_);
  }

 private:
  std::string word_;
  std::atomic<bool> matched_{false};
};

template <class Message>
void listen(dds::DomainParticipant& participant, const std::string& topic, const char* word, bool reliable = true,
            bool latched = false) {
  static std::deque<Listener<Message>> listeners;
  dds::DataReaderQos qos;
  qos.reliability().kind = reliable ? dds::RELIABLE_RELIABILITY_QOS : dds::BEST_EFFORT_RELIABILITY_QOS;
  qos.durability().kind = latched ? dds::TRANSIENT_LOCAL_DURABILITY_QOS : dds::VOLATILE_DURABILITY_QOS;
  qos.history().depth = 400; // Fast DDS's limit of a topic
  qos.endpoint().history_memory_policy = kAsNeeded;
  participant.create_subscriber(dds::SUBSCRIBER_QOS_DEFAULT)
      ->create_datareader(topic_of<Message>(participant, topic), qos, &listeners.emplace_back(word));
}

template <class Message>
dds::DataWriter* writer(dds::DomainParticipant& participant, const std::string& topic, bool reliable) {
  dds::DataWriterQos qos;
  qos.reliability().kind = reliable ? dds::RELIABLE_RELIABILITY_QOS : dds::BEST_EFFORT_RELIABILITY_QOS;
  qos.endpoint().history_memory_policy = kAsNeeded;
  return participant.create_publisher(dds::PUBLISHER_QOS_DEFAULT)
      ->create_datawriter(topic_of<Message>(participant, topic), qos);
}

void talk(dds::DomainParticipant& participant) {
  dds::DataWriter* imus = writer<FastImu>(participant, "/imu/data", false);
  dds::DataWriter* odometries = writer<FastOdometry>(participant, "/wheel_odometry", true);
  dds::DataWriter* healths = writer<FastBool>(participant, "/wheel_health", true);
  talk_on([&](int i) {
    const Said said(i);
    FastImu imu;
    imu.header = {said.sec, said.nanosec, "imu_link"};
    imu.orientation_xyzw = {0, 0, 0, 1};
    imu.angular_velocity = {0, 0, said.figure};
    imu.linear_acceleration = {0, 0, 9.81};
    FastOdometry odometry;
    odometry.header = {said.sec, said.nanosec, ""};
    odometry.pose.xyz_xyzw = {said.figure, 0, 0, 0, 0, 0, 1};
    odometry.twist_covariance[0] = 0.01;
    FastBool health{i % 2 == 0};
    imus->write(&imu);
    odometries->write(&odometry);
    healths->write(&health);
  });
}

/// Returns a reliable writer of clouds: an asynchronous thread sends messages larger than a datagram.
template <class Cloud> dds::DataWriter* cloud_writer(dds::DomainParticipant& participant) {
  dds::DataWriterQos qos;
  qos.reliability().kind = dds::RELIABLE_RELIABILITY_QOS;
  qos.publish_mode().kind = dds::ASYNCHRONOUS_PUBLISH_MODE;
  qos.history().depth = 1;
  qos.endpoint().history_memory_policy = kAsNeeded;
  return participant.create_publisher(dds::PUBLISHER_QOS_DEFAULT)
      ->create_datawriter(topic_of<Cloud>(participant, "/points"), qos);
}

/// Publishes a room ten times a second.
void talk_of_clouds(dds::DomainParticipant& participant) {
  dds::DataWriter* const clouds = cloud_writer<FastCloud>(participant);
  FastCloud cloud;
  cloud.header.frame_id = "lidar";
  cloud.height = 1;
  cloud.width = room_cloud::kPoints;
  for (const room_cloud::Field& field : room_cloud::kFields)
    cloud.point_fields.push_back({field.name, field.offset, field.type, 1});
  cloud.point_step = room_cloud::kStep;
  cloud.row_step = room_cloud::kStep * room_cloud::kPoints;
  cloud.data = room_cloud::points();
  talk_of_turns([&](std::int32_t sec, std::uint32_t nanosec) {
    cloud.header.sec = sec;
    cloud.header.nanosec = nanosec;
    clouds->write(&cloud);
  });
}

/// Publishes the room ten times a second, as Livox' driver does.
void talk_as_livox(dds::DomainParticipant& participant) {
  dds::DataWriter* const clouds = cloud_writer<FastLivoxCloud>(participant);
  FastLivoxCloud cloud;
  cloud.header.frame_id = "lidar";
  for (const room_cloud::LivoxPoint& point : room_cloud::livox_points())
    cloud.points.push_back({point.offset_ns, point.xyz_m, point.reflectivity, 0, point.line});
  cloud.point_num = static_cast<std::uint32_t>(cloud.points.size());
  talk_of_turns([&](std::int32_t sec, std::uint32_t nanosec) {
    cloud.header.sec = sec;
    cloud.header.nanosec = nanosec;
    cloud.timebase = static_cast<std::uint64_t>(sec) * 1'000'000'000 + nanosec;
    clouds->write(&cloud);
  });
}

void hear_all(dds::DomainParticipant& participant, const std::string& prefix) {
  listen<FastOdometry>(participant, prefix + "/odometry", "odometry");
  listen<FastUInt8>(participant, prefix + "/state", "state");
  listen<FastTransforms>(participant, "/tf", "tf");
  listen<FastCloud>(participant, prefix + "/cloud", "cloud", false);
  listen<FastCloud>(participant, prefix + "/map", "map", true, true);
  listen<FastDiagnostics>(participant, "/diagnostics", "diagnostics");
  listen<FastDiagnostics>(participant, prefix + "/beginning", "beginning", true, true);
  listen<FastUInt8>(participant, prefix + "/resets", "resets", true, true);
  listen<FastClock>(participant, "/clock", "clock", false);
  listen<FastImu>(participant, "/imu/data", "imu", false);
  tell("listens");
}

void run(int argc, char** argv) {
  if (argc != 4 && argc != 5)
    throw std::runtime_error("usage: fast_dds_peer DOMAIN listen|talk|iron|humble|clouds|livox PREFIX [ADDRESS]");
  static Discovery discovery;
  const auto domain = static_cast<std::uint32_t>(std::atoi(argv[1])); // NOLINT
  const std::string role = argv[2];
  const bool sees_graph = role == "iron" || role == "humble";
  dds::DomainParticipant& participant =
      *join(domain, argc == 5 ? argv[4] : "127.0.0.1", sees_graph ? &discovery : nullptr);
  if (role == "talk")
    return talk(participant);
  if (role == "clouds")
    return talk_of_clouds(participant);
  if (role == "livox")
    return talk_as_livox(participant);
  if (role == "iron")
    listen<FastParticipantEntities<16>>(participant, "ros_discovery_info", "node", true, true);
  else if (role == "humble")
    listen<FastParticipantEntities<24>>(participant, "ros_discovery_info", "node", true, true);
  else
    hear_all(participant, argv[3]);
  while (stdin_is_open())
    std::this_thread::sleep_for(std::chrono::milliseconds{20});
}

} // namespace
} // namespace locus::test

int main(int argc, char** argv) {
  try {
    locus::test::run(argc, argv);
  } catch (const std::exception& error) {
    fmt::print(stderr, "fast_dds_peer: {}\n", error.what());
    return 1;
  }
  std::_Exit(0); // the library's shutdown is slow
}
