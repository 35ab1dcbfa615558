// SPDX-License-Identifier: Apache-2.0
#include "daemon/service/control.hpp"

#include <gtest/gtest.h>

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/un.h>
#include <unistd.h>

#include "support/errors.hpp"
#include "support/temporary_folder.hpp"

namespace locus::daemon {
namespace {

TEST(ControlRequest, ParsesWhatLocusctlSends) {
  const auto is = [](const char* message, auto kind) {
    const auto request = parse_control_request(message);
    return request && std::holds_alternative<decltype(kind)>(*request);
  };
  EXPECT_TRUE(is(R"({"command": "status"})", ShowStatus{}));
  EXPECT_FALSE(std::get<ShowStatus>(*parse_control_request(R"({"command": "status"})")).as_text);
  EXPECT_TRUE(std::get<ShowStatus>(*parse_control_request(R"({"command": "status", "text": true})")).as_text);
  EXPECT_TRUE(is(R"({"command": "save-map", "more": 1})", SaveMap{}));
  EXPECT_TRUE(is(R"({"command": "view"})", ShowSweep{}));
  EXPECT_TRUE(is(R"({"command": "reload"})", Reload{}));
  const auto keep = parse_control_request(R"({"command": "record", "keep_s": 60})");
  ASSERT_TRUE(keep);
  EXPECT_EQ(std::get<StoreIncident>(*keep).keep_s, 60);
  const auto flat = parse_control_request(R"({"command": "flat-ground", "mode": "auto"})");
  ASSERT_TRUE(flat);
  EXPECT_EQ(std::get<SetFlatGround>(*flat).mode, FlatGround::automatic);
  const auto reset = parse_control_request(R"({"command": "reset"})");
  ASSERT_TRUE(reset);
  EXPECT_FALSE(std::get<Reset>(*reset).T_odom_base);
  const auto there = parse_control_request(R"({"command": "reset", "pose": [1, -2, 0.5, 0, 0, 90]})");
  ASSERT_TRUE(there);
  const Pose T_odom_base = std::get<Reset>(*there).T_odom_base.value_or(Pose{});
  EXPECT_EQ(T_odom_base.translation, Eigen::Vector3d(1, -2, 0.5));
  EXPECT_NEAR(to_rpy_rad(T_odom_base.rotation).z() / kRadPerDeg, 90, 1e-9);
}

TEST(ControlRequest, IncompleteRequestIsRejected) {
  for (const char* message :
       {"", "{", "[]", "7", "null", "\xff", "{}", R"({"command": 7})", R"({"command": null})",
        R"({"command": "flat-ground"})", R"({"command": "flat-ground", "mode": 1})", R"({"command": "record"})",
        R"({"command": "record", "keep_s": "60s"})", R"({"command": "reset", "pose": 1})",
        R"({"command": "reset", "pose": [1, 2, 3]})", R"({"command": "reset", "pose": [1, 2, 3, 4, 5, "a"]})",
        R"({"command": "reset", "pose": [1e999, 0, 0, 0, 0, 0]})"})
    EXPECT_TRUE(contains(error_of(parse_control_request(message)), "use locusctl of the same version")) << message;
  EXPECT_FALSE(parse_control_request(std::string(4096, '[')));
  EXPECT_EQ(error_of(parse_control_request(R"({"command": "dance"})")),
            "unknown command dance; use locusctl of the same version");
  EXPECT_EQ(error_of(parse_control_request(R"({"command": "flat-ground", "mode": "maybe"})")),
            "flat-ground must be on, off or auto");
}

TEST(ControlRequest, LengthToKeepIsWithinLimits) {
  for (const char* keep_s : {"0", "-1", "0.99", "600.1", "1e300"})
    EXPECT_EQ(error_of(parse_control_request(R"({"command": "record", "keep_s": )" + std::string(keep_s) + "}")),
              "the length to keep must be 1s to 600s")
        << keep_s;
}

TEST(ControlRequest, PoseIsWithinLimits) {
  for (const char* pose : {"[1e300, 0, 0, 0, 0, 0]", "[0, -500001, 0, 0, 0, 0]", "[0, 0, 0, 0, 0, 361]"})
    EXPECT_TRUE(contains(error_of(parse_control_request(R"({"command": "reset", "pose": )" + std::string(pose) + "}")),
                         "the pose must lie within 500000 m and 360 degrees"))
        << pose;
}

/// A server driven by the test, and its clients.
class ControlServerTest : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_EQ(chmod(path_.parent_path().c_str(), 0755), 0);
    auto server = ControlServer::open(path_, [this](const ControlRequest&) {
      ++handled_;
      return ControlServer::Answer::done();
    });
    ASSERT_TRUE(server) << server.error();
    server_.emplace(std::move(*server));
  }

  [[nodiscard]] Descriptor connected() const {
    Descriptor client{::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK | SOCK_CLOEXEC, 0)};
    sockaddr_un address{AF_UNIX, {}};
    path_.native().copy(address.sun_path, sizeof(address.sun_path) - 1);
    EXPECT_EQ(connect(client.number(), reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
    return client;
  }
  [[nodiscard]] Descriptor connected_stranger() const {
    Descriptor client;
    std::thread([&] {
      constexpr int kNobody = 65534;
      syscall(SYS_setgroups, 0, nullptr); // this thread only
      syscall(SYS_setresuid, kNobody, kNobody, kNobody);
      client = connected();
    }).join();
    return client;
  }

  static void say(const Descriptor& client, std::string_view request) {
    EXPECT_EQ(::send(client.number(), request.data(), request.size(), MSG_NOSIGNAL),
              static_cast<ssize_t>(request.size()));
  }
  /// Returns the next answer, nothing if there is none yet, and an empty string if the server has hung up.
  static std::optional<std::string> answer(const Descriptor& client) {
    std::array<char, 4096> text{};
    const ssize_t size = recv(client.number(), text.data(), text.size(), MSG_DONTWAIT);
    return size < 0 ? std::nullopt : std::optional{std::string(text.data(), static_cast<std::size_t>(size))};
  }

  test::TemporaryFolder folder_;
  std::filesystem::path path_ = folder_ / "control";
  int handled_ = 0;
  std::optional<ControlServer> server_;
};

TEST_F(ControlServerTest, SweepsAreForPrivilegedClientsOnly) {
  if (geteuid() != 0)
    GTEST_SKIP() << "no second user to be: run as root";
  const Descriptor stranger = connected_stranger();
  say(stranger, R"({"command": "view"})");
  server_->serve();
  EXPECT_TRUE(contains(answer(stranger).value_or(""), "not permitted"));
  EXPECT_EQ(handled_, 0);
}

/// The caller of serve() pauses after it, so that requests cost at most this many answers per round.
TEST_F(ControlServerTest, AnswersEachOfSixteenClientsOncePerRound) {
  std::vector<Descriptor> clients;
  for (std::size_t i = 0; i < ControlServer::kMaxClients; ++i) {
    clients.push_back(connected());
    EXPECT_TRUE(server_->serve());
  }
  EXPECT_FALSE(server_->serve()) << "nobody has asked";
  for (const Descriptor& client : clients)
    for (int i = 0; i < 3; ++i)
      say(client, R"({"command": "status"})");
  for (int round = 1; round <= 3; ++round) {
    EXPECT_TRUE(server_->serve());
    EXPECT_EQ(handled_, round * static_cast<int>(ControlServer::kMaxClients));
  }
  EXPECT_FALSE(server_->serve());
  const Descriptor one_more = connected();
  EXPECT_TRUE(server_->serve());
  EXPECT_TRUE(contains(answer(one_more).value_or(""), "too many clients"));
}

TEST_F(ControlServerTest, UnprivilegedClientsDoNotBlockPrivilegedOnes) {
  if (geteuid() != 0)
    GTEST_SKIP() << "no second user to be: run as root";
  std::vector<Descriptor> strangers;
  for (std::size_t i = 0; i < ControlServer::kMaxClients; ++i) {
    strangers.push_back(connected_stranger());
    EXPECT_TRUE(server_->serve());
  }
  say(strangers.back(), R"({"command": "reset"})");
  EXPECT_TRUE(server_->serve());
  EXPECT_TRUE(contains(answer(strangers.back()).value_or(""), "not permitted"));
  const Descriptor one_more = connected_stranger();
  EXPECT_TRUE(server_->serve());
  EXPECT_TRUE(contains(answer(one_more).value_or(""), "too many clients"));
  const Descriptor ours = connected();
  say(ours, R"({"command": "reset"})");
  EXPECT_TRUE(server_->serve());
  EXPECT_EQ(handled_, 1);
  EXPECT_TRUE(contains(answer(ours).value_or(""), "done"));
  EXPECT_EQ(answer(strangers.front()), "") << "the one that came first";
}

} // namespace
} // namespace locus::daemon
