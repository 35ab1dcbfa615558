// SPDX-License-Identifier: Apache-2.0
// Hand-over of sweeps to a viewer, and the command that serves them to a browser.
#include <array>
#include <csignal>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <thread>

#include <fmt/format.h>
#include <sys/socket.h>
#include <sys/un.h>

#include "core/base/surface_point.hpp"
#include "daemon/descriptor.hpp"
#include "drivers/net/socket_address.hpp"
#include "locus_replay/failure.hpp"
#include "locusctl/service_client.hpp"
#include "service/robot_network.hpp"

namespace locus::test {
namespace {

class View : public RobotNetwork {
 protected:
  /// Starts the service and a drive without an end.
  void drive() {
    daemon_.emplace(locusd(config()));
    ASSERT_TRUE(daemon_->wait_for_line("DDS is up"));
    play_.emplace(endlessly(capture()));
    ASSERT_TRUE(daemon_->wait_for_line("tracking"));
  }

  /// Returns the first answer with a sweep of which this holds.
  [[nodiscard]] tools::ServiceAnswer
  answer_when(const std::function<bool(const nlohmann::ordered_json&)>& holds) const {
    const tools::ServiceConnection service(control());
    tools::ServiceAnswer answer;
    EXPECT_TRUE(comes_true([&] {
      answer = service.request({{"command", "view"}});
      return answer.json.contains("sweep") && holds(answer.json["sweep"]);
    })) << answer.json.dump();
    return answer;
  }

  std::optional<Child> daemon_, play_;
};

TEST_F(View, NewestSweepIsHandedOutWithTheStatus) {
  ASSERT_NO_FATAL_FAILURE(drive());
  const auto any = [](const nlohmann::ordered_json& /*sweep*/) { return true; };
  const tools::ServiceAnswer first = answer_when(any);
  EXPECT_EQ(first.bytes.size() % sizeof(SurfacePoint), 0U);
  EXPECT_GT(first.bytes.size(), 100 * sizeof(SurfacePoint));
  EXPECT_EQ(first.json["status"]["sources"].size(), status()["sources"].size());
  const auto sequence = first.json["sweep"]["sequence"].get<std::uint64_t>();
  const tools::ServiceAnswer later =
      answer_when([&](const nlohmann::ordered_json& sweep) { return sweep["sequence"] > sequence; });
  EXPECT_EQ(later.json["sweep"]["run"], first.json["sweep"]["run"]);
}

TEST_F(View, ResetBeginsAnotherRun) {
  ASSERT_NO_FATAL_FAILURE(drive());
  const auto first = answer_when([](const nlohmann::ordered_json& /*sweep*/) { return true; }).json["sweep"]["run"];
  ASSERT_EQ(ctl({"reset"}).status, 0);
  EXPECT_GT(
      answer_when([&](const nlohmann::ordered_json& sweep) { return sweep["run"] != first; }).json["sweep"]["run"],
      first);
}

TEST_F(View, BeforeTheFirstSweepTheStatusIsHandedOutAlone) {
  const Child daemon(locusd(config()));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  const tools::ServiceAnswer answer = tools::send_request(control(), {{"command", "view"}});
  EXPECT_EQ(answer.json["status"]["state"], "waiting");
  EXPECT_FALSE(answer.json.contains("sweep"));
  EXPECT_TRUE(answer.bytes.empty());
}

/// Two viewers: one requests without a pause, the other requests as often and never reads an answer.
class Viewers {
 public:
  explicit Viewers(const std::filesystem::path& control)
      : control_(control), silent_(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    control.native().copy(address.sun_path, sizeof(address.sun_path) - 1);
    EXPECT_EQ(connect(silent_.number(), reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
    thread_ = std::jthread{[this](const std::stop_token& stop) {
      while (!stop.stop_requested())
        try {
          view(stop);
        } catch (const tools::Failure&) { // an answer took seconds on a busy computer: connects again
        }
    }};
  }

  /// Ends both. Returns the number of sweeps that the first was shown.
  int end() {
    thread_.request_stop();
    thread_.join();
    return sweeps_;
  }

 private:
  void view(const std::stop_token& stop) {
    const tools::ServiceConnection service(control_);
    std::uint64_t last = 0;
    while (!stop.stop_requested()) {
      constexpr std::string_view kRequest = R"({"command":"view"})";
      ::send(silent_.number(), kRequest.data(), kRequest.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
      const auto answer = service.request({{"command", "view"}}).json;
      const std::uint64_t sequence = answer.contains("sweep") ? answer["sweep"]["sequence"].get<std::uint64_t>() : last;
      sweeps_ += sequence == last ? 0 : 1;
      last = sequence;
    }
  }

  std::filesystem::path control_;
  daemon::Descriptor silent_;
  int sweeps_ = 0;
  std::jthread thread_; ///< last: uses the others
};

TEST_F(View, ViewersNeitherDelayNorChangeAnEstimate) {
  const std::filesystem::path drive = plant();
  const Child daemon(led_locusd(drive / "config.yaml"));
  const Child listener({CYCLONE_PEER, "0", "listen", "/locus"});
  ASSERT_TRUE(hears_the_service(listener));
  Viewers viewers(control());
  Child play(leading_play({drive.string()}));
  ASSERT_EQ(play.wait_for_exit(patience_of_a_drive()), 0) << testing::PrintToString(play.lines());
  EXPECT_TRUE(status_comes([](const nlohmann::json& s) { return s["lidars"].front()["heard_ms_ago"] > 300; }));
  EXPECT_GT(viewers.end(), 20);
  const Replay replay({"--quiet", drive.string()});
  ASSERT_EQ(replay.run().status, 0) << replay.run().err;
  expect_each_received(replay.trajectory(), heard(listener), shift_of(play), "listener");
}

/// Returns the answer of the command's server.
std::string get(std::string_view target, std::string_view host = "127.0.0.1:8042") {
  const auto address = parse_socket_address("127.0.0.1:8042");
  const daemon::Descriptor client{::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)};
  EXPECT_EQ(connect(client.number(), reinterpret_cast<const sockaddr*>(&address->storage), address->size), 0);
  const std::string request = fmt::format("GET {} HTTP/1.1\r\nHost: {}\r\n\r\n", target, host);
  EXPECT_GT(::send(client.number(), request.data(), request.size(), MSG_NOSIGNAL), 0);
  std::string all;
  std::array<char, 65536> bytes{};
  for (ssize_t size = 0; (size = recv(client.number(), bytes.data(), bytes.size(), 0)) > 0;)
    all.append(bytes.data(), static_cast<std::size_t>(size));
  return all;
}

TEST_F(View, CommandServesThePageAndTheDriveUntilItIsInterrupted) {
  ASSERT_NO_FATAL_FAILURE(drive());
  Child view({LOCUSCTL, "--socket", control().string(), "view"});
  ASSERT_TRUE(view.wait_for_line("http://127.0.0.1:8042/")) << testing::PrintToString(view.lines());
  EXPECT_NE(get("/").find("</html>"), std::string::npos);
  EXPECT_TRUE(comes_true([] {
    const std::string answer = get("/live?epoch=0");
    return answer.find("\"state\":\"tracking\"") != std::string::npos &&
           answer.find("\"tiles\":{\"from\":0,\"count\":0") == std::string::npos;
  }));
  EXPECT_TRUE(get("/live", "evil.example").starts_with("HTTP/1.1 403 "));
  view.signal(SIGINT);
  EXPECT_EQ(view.wait_for_exit(), 128 + SIGINT);
}

TEST_F(View, PortIsOfTheLoopbackInterfaceOnly) {
  if (!add_interfaces())
    GTEST_SKIP() << "no pair of interfaces";
  const Child view({LOCUSCTL, "--socket", control().string(), "view"});
  ASSERT_TRUE(view.wait_for_line("http://127.0.0.1:8042/"));
  const auto address = parse_socket_address("10.7.0.1:8042");
  const daemon::Descriptor client{::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)};
  EXPECT_NE(connect(client.number(), reinterpret_cast<const sockaddr*>(&address->storage), address->size), 0);
}

} // namespace
} // namespace locus::test
