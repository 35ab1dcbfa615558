// SPDX-License-Identifier: Apache-2.0
// Hand-over of sweeps to a viewer, and the command that serves them to a browser.
#include <array>
#include <csignal>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include <fmt/format.h>
#include <sys/socket.h>

#include "core/base/surface_point.hpp"
#include "daemon/descriptor.hpp"
#include "drivers/net/socket_address.hpp"
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
