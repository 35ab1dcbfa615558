// SPDX-License-Identifier: Apache-2.0
#include "daemon/dds/ros_link.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <functional>
#include <memory>
#include <mutex>
#include <set>
#include <sstream>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "daemon/dds/dds_node.hpp"
#include "daemon/dds/ros_messages.hpp"
#include "dds/peer_words.hpp"
#include "support/child.hpp"
#include "support/dds_domain.hpp"

namespace locus::daemon {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

bool eventually(const std::function<bool()>& holds) {
  const auto give_up = std::chrono::steady_clock::now() + test::patience();
  while (!holds()) {
    if (std::chrono::steady_clock::now() > give_up)
      return false;
    std::this_thread::sleep_for(milliseconds{5});
  }
  return true;
}

/// Collects received messages.
class Inbox {
 public:
  RosLink::Sink sink() {
    return [this](const RosInput& input) {
      const std::scoped_lock lock(mutex_);
      inputs_.push_back(input);
    };
  }
  template <class Kind> std::vector<Kind> all() const {
    const std::scoped_lock lock(mutex_);
    std::vector<Kind> found;
    for (const RosInput& input : inputs_)
      if (const Kind* one = std::get_if<Kind>(&input))
        found.push_back(*one);
    return found;
  }

 private:
  mutable std::mutex mutex_;
  std::vector<RosInput> inputs_;
};

Config config_in(const test::DdsDomain& domain) {
  Config config;
  config.dds.domain = domain.number();
  config.dds.prefix = "/robot_7/locus";
  config.dds.publish_tf = config.dds.publish_cloud = config.dds.publish_map = true;
  config.dds.flat_ground_topic = "/flat_ground";
  config.motion_sources[0].health_topic = "/wheel_health";
  return config;
}

/// A topic with a writer and a reader of clouds, in one process.
struct CloudTopic {
  explicit CloudTopic(TopicQos qos)
      : node(std::move(*DdsNode::open(config_in(domain).dds))), writer(node, "/points", qos),
        reader(node, "/points", qos) {}

  void write() { ASSERT_TRUE(writer.write(message.make({}, Stamp{}, frame))); }

  test::DdsDomain domain;
  DdsNode node;
  DdsWriter<ros::PointCloud2> writer;
  DdsReader<ros::PointCloud2> reader;
  CloudMessage message;
  std::string frame = "lidar";
};

TEST(CloudTopic, CountsAllMessagesBetweenTwoCalls) {
  for (const auto& [qos, counted] : {std::pair{TopicQos::cloud_count(), 12}, {TopicQos::cloud_in(), 1}}) {
    CloudTopic topic(qos);
    ASSERT_TRUE(eventually([&] { return topic.writer.has_readers(); }));
    for (int i = 0; i < 12; ++i)
      topic.write();
    int clouds = 0;
    topic.reader.take_serialised([&](const auto&, auto) { ++clouds; });
    EXPECT_EQ(clouds, counted);
  }
}

/// take() terminates even if messages keep arriving, here one during each callback.
TEST(CloudTopic, TakeTerminatesUnderConstantTraffic) {
  constexpr int kGiveUp = 1000;
  for (const TopicQos qos : {TopicQos::cloud_count(), TopicQos::cloud_in()}) {
    CloudTopic topic(qos);
    ASSERT_TRUE(eventually([&] { return topic.writer.has_readers(); }));
    topic.write();
    int clouds = 0;
    topic.reader.take_serialised([&](const auto&, auto) {
      if (++clouds < kGiveUp)
        topic.write();
    });
    EXPECT_LE(clouds, 32);
  }
}

OdometryReport report(int i) {
  OdometryReport report;
  report.stamp = stamp_from_ns(1'700'000'000'000'000'000 + i * 100'000'000LL);
  report.T_odom_base.translation = {i / 8.0, 2, 3};
  report.T_odom_base.rotation = from_rpy_rad({0, 0, 0.5});
  report.pose_covariance(5, 5) = 0.25;
  report.twist_base[5] = 0.75;
  return report;
}

class Peers : public testing::TestWithParam<const char*> {
 protected:
  [[nodiscard]] std::vector<std::string> peer(const char* role) const {
    return {GetParam(), std::to_string(domain_.number()), role, "/robot_7/locus"};
  }

  test::DdsDomain domain_;
  Config config_ = config_in(domain_);
  Inbox inbox_;
};

TEST_P(Peers, ReceiveOdometryStateTransformCloudAndDiagnostics) {
  test::Child listener(peer("listen"));
  RosLink link(config_, inbox_.sink());
  const std::vector<CloudMessage::Point> points(2'000, {1, 2, 3, 4, 0, 5, 0}); // more needs larger socket buffers
  const auto hears_all = [&] {
    for (const char* word : {"odometry", "state", "tf", "cloud", "diagnostics"})
      if (listener.lines_of(word).size() < 3)
        return false;
    return true;
  };
  int sent = 0;
  ASSERT_TRUE(eventually([&] {
    link.publish(report(++sent), TrackingState::degenerate);
    link.publish_cloud(points, stamp_from_ns(1));
    link.publish(DiagnosticsMessage({{Diagnostic::Level::error, "locusd", "", {{"a", "b"}}}}, stamp_from_ns(1)));
    std::this_thread::sleep_for(milliseconds{20});
    return hears_all();
  })) << testing::PrintToString(listener.lines());
  listener.close_stdin();
  EXPECT_EQ(listener.wait_for_exit(), 0);

  std::istringstream row(listener.lines_of("odometry").back());
  double t = 0, x = 0, y = 0, z = 0, qx = 0, qy = 0, qz = 0, qw = 0, yaw_variance = 0, yaw_rate = 0;
  std::string frame, child;
  row >> t >> x >> y >> z >> qx >> qy >> qz >> qw >> frame >> child >> yaw_variance >> yaw_rate;
  EXPECT_NEAR((t - 1.7e9) * 10, x * 8, 1e-4) << "stamp and pose are those of one report";
  EXPECT_EQ(z, 3.0);
  EXPECT_NEAR(qz, std::sin(0.25), 1e-9);
  EXPECT_EQ(frame + ' ' + child, "odom base_link");
  EXPECT_EQ(yaw_variance, 0.25);
  EXPECT_EQ(yaw_rate, 0.75);
  EXPECT_EQ(listener.lines_of("state").back(), "1");
  EXPECT_EQ(listener.lines_of("tf").back().substr(0, 14), "odom base_link");
  EXPECT_EQ(listener.lines_of("cloud").back(), "2000 24 48000 7 base_link");
  EXPECT_EQ(listener.lines_of("diagnostics").back(), "2 1 locusd");
}

TEST_P(Peers, LateSubscribersReceiveBeginningAndMapOnce) {
  const std::vector<CloudMessage::Point> points(100, {1, 2, 3, 0, 0, 0, 0});
  RosLink link(config_, inbox_.sink());
  ASSERT_TRUE(eventually([&] {
    return link.publish_beginning(
        DiagnosticsMessage({{Diagnostic::Level::warning, "locusd: beginning", "", {{"from", "map"}}}},
                           stamp_from_ns(1)),
        259);
  }));
  link.publish_map(points, stamp_from_ns(1));
  const test::Child listener(peer("listen"));
  EXPECT_TRUE(eventually([&] {
    return !listener.lines_of("beginning").empty() && !listener.lines_of("resets").empty() &&
           !listener.lines_of("map").empty();
  }));
  EXPECT_EQ(listener.lines_of("map").size(), 1U);
  EXPECT_EQ(listener.lines_of("beginning"), std::vector<std::string>{"1 1 locusd: beginning"});
  EXPECT_EQ(listener.lines_of("resets"), std::vector<std::string>{"3"}) << "modulo 256";
}

TEST_P(Peers, SamplesArriveInOrderWithEveryFigure) {
  RosLink link(config_, inbox_.sink());
  test::Child talker(peer("talk"));
  EXPECT_TRUE(eventually([&] {
    return inbox_.all<ImuInput>().size() > 50 && inbox_.all<OdometryInput>().size() > 50 &&
           inbox_.all<ExternalHealth>().size() > 50;
  }));
  const LinkFigures status = link.status();
  EXPECT_TRUE(status.connected);
  EXPECT_EQ(status.sources[1].writers, 1U);
  EXPECT_GE(inbox_.all<ImuInput>().size(), status.sources[1].received);
  talker.close_stdin();
  const std::vector<ImuInput> imus = inbox_.all<ImuInput>();
  ASSERT_FALSE(imus.empty());
  const auto number_of = [](double figure) { return static_cast<int>(figure * 8); };
  int last = -1;
  for (const ImuInput& imu : imus) {
    const int i = number_of(imu.sample.angular_velocity_radps.z());
    const test::Said said(i);
    EXPECT_EQ(imu.source, SourceId{1});
    EXPECT_EQ(imu.sample.stamp, to_stamp({said.sec, said.nanosec}));
    EXPECT_EQ(imu.sample.specific_force_mps2.z(), 9.81);
    EXPECT_GT(i, last);
    last = i;
  }
  for (const OdometryInput& odometry : inbox_.all<OdometryInput>()) {
    const test::Said said(number_of(odometry.sample.T_source_base.translation.x()));
    EXPECT_EQ(odometry.source, SourceId{0});
    EXPECT_EQ(odometry.sample.stamp, to_stamp({said.sec, said.nanosec}));
    EXPECT_NEAR(odometry.sample.covariance_scale, 1.0, 1e-9);
  }
  EXPECT_EQ(inbox_.all<ExternalHealth>().front().source, SourceId{0});
}

/// A participant as discovered by a peer: its DDS endpoints, and the endpoints that its node claims.
struct HeardNode {
  std::string name;
  std::multiset<std::string> readers, writers, node_readers, node_writers;
};

/// Returns nothing if no node was announced.
HeardNode heard_node(const test::Child& peer) {
  HeardNode heard;
  if (peer.lines_of("node_end").empty() || peer.lines_of("node").empty())
    return heard;
  const std::string node = peer.lines_of("node").back();
  const std::size_t gid = node.rfind(' ') + 1;
  heard.name = node.substr(0, gid - 1);
  constexpr std::size_t kPrefix = 24; // hexadecimal digits common to the GUIDs of a participant's endpoints
  const auto endpoints = [&](const char* kind) {
    std::multiset<std::string> found;
    for (const std::string& line : peer.lines_of(kind))
      if (line.starts_with(node.substr(gid, kPrefix)) && line.find(" ros_discovery_info ") == std::string::npos)
        found.insert(line.substr(0, line.find(' ')) + node.substr(gid + 32)); // the gid of Humble is padded with zeros
    return found;
  };
  const auto claimed = [&](const char* kind) {
    const std::vector<std::string> lines = peer.lines_of(kind);
    return std::multiset<std::string>(lines.begin(), lines.end());
  };
  return {heard.name, endpoints("reader"), endpoints("writer"), claimed("node_reader"), claimed("node_writer")};
}

/// Both message layouts; peers that start before the node, and after it.
TEST_P(Peers, ListOneNodeWithAllEndpoints) {
  for (const auto& [graph, word] : {std::pair{RosGraph::iron, "iron"}, std::pair{RosGraph::humble, "humble"}}) {
    config_.dds.ros_graph = graph;
    const test::Child early(peer(word));
    {
      const auto herald = DdsNode::open(config_.dds);
      ASSERT_TRUE(herald) << herald.error();
      const DdsWriter<ros::Bool> word_of_it{*herald, "/herald", TopicQos::standard()};
      ASSERT_TRUE(early.wait_for_line("herald")) << "it hears who comes";
    }
    const RosLink link(config_, inbox_.sink(), "left-arm");
    ASSERT_TRUE(eventually([&] { return link.status().connected; }));
    const test::Child late(peer(word));
    for (const test::Child* one : {&early, &late}) {
      constexpr std::size_t kReaders = 4, kWriters = 9;
      EXPECT_TRUE(eventually([&] {
        const HeardNode heard = heard_node(*one);
        return heard.readers.size() >= kReaders && heard.writers.size() >= kWriters && !heard.node_writers.empty();
      })) << testing::PrintToString(one->lines());
      const HeardNode heard = heard_node(*one);
      EXPECT_EQ(heard.name, "/robot_7 locusd_left_x2darm");
      EXPECT_EQ(heard.node_readers, heard.readers);
      EXPECT_EQ(heard.node_writers, heard.writers);
      EXPECT_EQ(heard.readers.size(), kReaders);
      EXPECT_EQ(heard.writers.size(), kWriters);
    }
  }
}

TEST_P(Peers, ListNoNodeIfTheGraphIsOff) {
  config_.dds.ros_graph = RosGraph::off;
  auto link = std::make_unique<RosLink>(config_, inbox_.sink());
  const test::Child listener(peer("iron"));
  ASSERT_TRUE(eventually([&] { return listener.lines_of("writer").size() >= 8; }));
  link.reset();
  config_.dds.ros_graph = RosGraph::iron;
  const RosLink other(config_, inbox_.sink(), "other"); // its node serves as an end marker
  ASSERT_TRUE(eventually([&] { return !listener.lines_of("node_end").empty(); }));
  for (const std::string& node : listener.lines_of("node"))
    EXPECT_TRUE(node.starts_with("/robot_7 locusd_other ")) << testing::PrintToString(listener.lines());
}

INSTANTIATE_TEST_SUITE_P(Dds, Peers, testing::Values(CYCLONE_PEER, FAST_DDS_PEER), [](const auto& peer) {
  return std::string(peer.param).find("fast") == std::string::npos ? "Cyclone" : "FastDds";
});

/// Two publishers on a source's topic would look like one that jumps: the first owns it until it disappears.
TEST(RosLink, TopicBelongsToTheFirstPublisherUntilItLeaves) {
  const test::DdsDomain domain;
  Inbox inbox;
  RosLink link(config_in(domain), inbox.sink());
  const std::vector<std::string> talker{CYCLONE_PEER, std::to_string(domain.number()), "talk", "/locus"};
  test::Child first(talker);
  ASSERT_TRUE(eventually([&] { return inbox.all<ImuInput>().size() > 100; }));
  const test::Child second(talker);
  const auto imu = [&] { return link.status().sources[1]; };
  ASSERT_TRUE(eventually([&] { return imu().refused > 100; }));
  EXPECT_TRUE(eventually([&] { return link.status().sources[0].health_refused > 100; }));
  const std::vector<std::string> commander{CYCLONE_PEER, std::to_string(domain.number()), "command", "/locus"};
  const test::Child commands(commander), contradicts(commander);
  EXPECT_TRUE(eventually([&] { return link.status().flat_ground_refused > 100; }));
  const auto is_in_order = [&] {
    double last = -1;
    return std::ranges::all_of(inbox.all<ImuInput>(), [&](const ImuInput& one) {
      return one.sample.angular_velocity_radps.z() > std::exchange(last, one.sample.angular_velocity_radps.z());
    });
  };
  EXPECT_TRUE(is_in_order()) << "the second counts from the beginning";
  EXPECT_EQ(imu().writers, 2U);
  first.close_stdin();
  ASSERT_EQ(first.wait_for_exit(), 0);
  EXPECT_TRUE(eventually([&] { return !is_in_order(); }));
}

/// Idle, unused writers must not take a topic from its owner.
TEST(RosLink, ManyWritersDoNotHideTheOwner) {
  const test::DdsDomain domain;
  DdsOptions options;
  options.domain = domain.number();
  const auto node = DdsNode::open(options);
  ASSERT_TRUE(node) << node.error();
  const DdsReader<ros::Bool> reader{*node, "/word", TopicQos::standard()};
  std::vector<DdsWriter<ros::Bool>> writers;
  for (int i = 0; i < 100; ++i)
    writers.emplace_back(*node, "/word", TopicQos::standard());
  ASSERT_TRUE(eventually([&] { return reader.writers() == writers.size(); }));
  std::vector<dds_instance_handle_t> all(writers.size());
  ASSERT_EQ(dds_get_matched_publications(reader.handle(), all.data(), all.size()), all.size());
  EXPECT_TRUE(std::ranges::all_of(all, [&](dds_instance_handle_t writer) { return reader.is_matched(writer); }));
}

/// Robots are distinguished by prefix or by domain. Each publishes a position of its own.
TEST(RosLink, RobotsOnOneNetworkAreSeparate) {
  const test::DdsDomain domain, other_domain;
  RosLink robot(config_in(domain), [](const RosInput&) {}), other(config_in(other_domain), [](const RosInput&) {});
  const auto peer_of = [](const test::DdsDomain& d, const char* prefix) {
    return test::Child({CYCLONE_PEER, std::to_string(d.number()), "listen", prefix});
  };
  const test::Child hears_robot = peer_of(domain, "/robot_7/locus"),
                    hears_other = peer_of(other_domain, "/robot_7/locus");
  const test::Child hears_none = peer_of(domain, "/robot_8/locus");
  EXPECT_TRUE(eventually([&] {
    robot.publish(report(1), TrackingState::tracking);
    other.publish(report(2), TrackingState::tracking);
    std::this_thread::sleep_for(milliseconds{20});
    return hears_robot.lines_of("odometry").size() >= 20 && hears_other.lines_of("odometry").size() >= 20;
  }));
  const auto sent = [](const std::string& line) { return line.substr(0, line.find(' ', line.find(' ') + 1)); };
  for (const std::string& line : hears_robot.lines_of("odometry"))
    EXPECT_EQ(sent(line), sent(hears_robot.lines_of("odometry").front()));
  EXPECT_NE(sent(hears_robot.lines_of("odometry").front()), sent(hears_other.lines_of("odometry").front()));
  EXPECT_TRUE(hears_none.lines_of("odometry").empty());
}

TEST(RosLink, MissingInterfaceIsNamedAndRetried) {
  const test::DdsDomain domain;
  Config config = config_in(domain);
  config.dds.interface = "nowhere7";
  RosLink link(config, [](const RosInput&) {});
  EXPECT_TRUE(eventually([&] { return link.status().attempts >= 2; }));
  EXPECT_FALSE(link.status().connected);
  EXPECT_NE(link.status().problem.find("interface nowhere7"), std::string::npos) << link.status().problem;
  EXPECT_FALSE(link.publish(report(1), TrackingState::tracking));
  const std::uint64_t before = link.progress();
  EXPECT_TRUE(eventually([&] { return link.progress() > before; })) << "waiting is no standstill";
}

TEST(RosLink, IdleLinkUsesNoCpu) {
  const test::DdsDomain domain;
  Config config = config_in(domain);
  config.motion_sources.clear();
  const RosLink link(config, [](const RosInput&) {});
  EXPECT_TRUE(eventually([&] { return link.status().connected; }));
  const std::uint64_t before = link.progress();
  const auto begin = std::chrono::steady_clock::now();
  std::this_thread::sleep_for(seconds{1});
  const std::chrono::duration<double> slept = std::chrono::steady_clock::now() - begin;
  EXPECT_LT(static_cast<double>(link.progress() - before), 100.0 * slept.count());
}

TEST(RosLink, IsGoneWithinASecond) {
  const test::DdsDomain domain;
  auto link = std::make_unique<RosLink>(config_in(domain), [](const RosInput&) {});
  EXPECT_TRUE(eventually([&] { return link->status().connected; }));
  const auto begin = std::chrono::steady_clock::now();
  link.reset();
  EXPECT_LT(std::chrono::steady_clock::now() - begin, seconds{1});
}

} // namespace
} // namespace locus::daemon
