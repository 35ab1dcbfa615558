// SPDX-License-Identifier: Apache-2.0
// A participant made with Fast DDS, ROS 2's default: fast_dds_peer DOMAIN listen|talk PREFIX [ADDRESS].
// On the loopback interface, or on that of ADDRESS. See peer_words.hpp.
#include <cstdlib>
#include <deque>
#include <memory>
#include <stdexcept>

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/Topic.hpp>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>

#include "dds/fast_dds_types.hpp"
#include "dds/peer_words.hpp"

namespace locus::test {
namespace {

namespace dds = eprosima::fastdds::dds;

constexpr auto kAsNeeded = eprosima::fastrtps::rtps::DYNAMIC_RESERVE_MEMORY_MODE; ///< and not as a message may need

dds::DomainParticipant* join(std::uint32_t domain, const std::string& address) {
  auto wire = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
  wire->interfaceWhiteList.push_back(address);
  dds::DomainParticipantQos qos;
  qos.transport().use_builtin_transports = false;
  qos.transport().user_transports.push_back(wire);
  dds::DomainParticipant* participant = dds::DomainParticipantFactory::get_instance()->create_participant(domain, qos);
  if (participant == nullptr)
    throw std::runtime_error("no participant");
  return participant;
}

template <class Message> dds::Topic* topic_of(dds::DomainParticipant& participant, const std::string& name) {
  dds::TypeSupport(new FastType<Message>).register_type(&participant); // NOLINT: TypeSupport owns it
  return participant.create_topic("rt" + name, Message::kName, dds::TOPIC_QOS_DEFAULT);
}

void say(const FastOdometry& m, const char* topic) {
  const auto& p = m.pose.xyz_xyzw;
  tell("{} {}.{:09} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {} {} {:.9g} {:.9g} {}", topic, m.header.sec,
       m.header.nanosec, p[0], p[1], p[2], p[3], p[4], p[5], p[6], m.header.frame_id, m.child_frame_id,
       m.pose_covariance[35], m.twist[5], realtime_ns());
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

 private:
  std::string word_;
};

template <class Message>
void listen(dds::DomainParticipant& participant, const std::string& topic, const char* word, bool reliable = true,
            bool latched = false) {
  static std::deque<Listener<Message>> listeners;
  dds::DataReaderQos qos;
  qos.reliability().kind = reliable ? dds::RELIABLE_RELIABILITY_QOS : dds::BEST_EFFORT_RELIABILITY_QOS;
  qos.durability().kind = latched ? dds::TRANSIENT_LOCAL_DURABILITY_QOS : dds::VOLATILE_DURABILITY_QOS;
  qos.history().depth = 100;
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

void run(int argc, char** argv) {
  if (argc != 4 && argc != 5)
    throw std::runtime_error("usage: fast_dds_peer DOMAIN listen|talk PREFIX [ADDRESS]");
  const auto domain = static_cast<std::uint32_t>(std::atoi(argv[1])); // NOLINT
  dds::DomainParticipant& participant = *join(domain, argc == 5 ? argv[4] : "127.0.0.1");
  const std::string prefix = argv[3];
  if (std::string(argv[2]) == "talk")
    return talk(participant);
  listen<FastOdometry>(participant, prefix + "/odometry", "odometry");
  listen<FastUInt8>(participant, prefix + "/state", "state");
  listen<FastTransforms>(participant, "/tf", "tf");
  listen<FastCloud>(participant, prefix + "/cloud", "cloud", false);
  listen<FastCloud>(participant, prefix + "/map", "map", true, true);
  listen<FastDiagnostics>(participant, "/diagnostics", "diagnostics");
  listen<FastDiagnostics>(participant, prefix + "/beginning", "beginning", true, true);
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
  std::_Exit(0); // the library takes its time to take leave
}
