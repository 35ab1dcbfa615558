// SPDX-License-Identifier: Apache-2.0
// Hand-over of sweeps to a viewer.
#include <cstdint>
#include <optional>

#include "core/base/surface_point.hpp"
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

} // namespace
} // namespace locus::test
