// SPDX-License-Identifier: Apache-2.0
// DDS Security as set up by docs/examples/dds-security.sh.
#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <string>
#include <vector>

#include "service/robot_network.hpp"

namespace locus::test {
namespace {

using nlohmann::json;

class DdsSecurity : public RobotNetwork {
 protected:
  [[nodiscard]] std::filesystem::path enclaves(const std::string& name) const {
    setenv("INPUTS", "/wheel_odometry /wheel_health /imu/data", 1); // NOLINT(concurrency-mt-unsafe)
    const ProgramRun run = run_program(DDS_SECURITY, {file(name).string(), "0"});
    EXPECT_EQ(run.status, 0) << run.err;
    return file(name);
  }
  static std::vector<std::string> peer(const char* role, const std::filesystem::path& enclave = {}) {
    return {CYCLONE_PEER, "0", role, "/locus", "lo", enclave.string()};
  }
  [[nodiscard]] std::filesystem::path secured(const std::filesystem::path& enclave) const {
    return config("dds: {security: " + enclave.string() + "}\n");
  }
};

/// A permitted participant exchanges data with the robot. Meanwhile participants without credentials, with those of
/// another authority, or without permission neither receive nor are received.
TEST_F(DdsSecurity, PeerWithoutCredentialsNeitherReceivesNorIsReceived) {
  const std::filesystem::path ours = enclaves("ours"), theirs = enclaves("theirs");
  Child daemon(locusd(secured(ours / "locusd")));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up")) << testing::PrintToString(daemon.lines());
  const Child viewer(peer("listen", ours / "viewer"));
  const Child stranger(peer("listen")), of_others(peer("listen", theirs / "viewer"));
  const Child talks(peer("talk")), talks_of_others(peer("talk", theirs / "sensors")),
      views_and_talks(peer("talk", ours / "viewer"));
  const auto told = [](const std::vector<std::string>& lines) {
    return std::ranges::count_if(lines, [](const std::string& line) {
      return line.starts_with("diagnostics ") && line.ends_with("locusd: lidar front");
    });
  };
  ASSERT_TRUE(viewer.wait_until([&](const auto& lines) { return told(lines) > 0; }))
      << testing::PrintToString(viewer.lines());
  const auto before = told(viewer.lines());
  ASSERT_TRUE(viewer.wait_until([&](const auto& lines) { return told(lines) > before + 4; })) << "one a second";
  for (const char* name : {"wio", "imu"}) {
    const json source = status()["sources"][name];
    EXPECT_EQ(source["received"], 0) << name;
    EXPECT_EQ(source["writers"], 0) << name;
  }
  for (const Child* peer : {&stranger, &of_others, &talks, &talks_of_others, &views_and_talks})
    EXPECT_EQ(kill(peer->pid(), 0), 0) << testing::PrintToString(peer->lines());
  EXPECT_TRUE(stranger.lines_of("diagnostics").empty()) << testing::PrintToString(stranger.lines());
  EXPECT_TRUE(of_others.lines_of("diagnostics").empty()) << testing::PrintToString(of_others.lines());

  const Child sensors(peer("talk", ours / "sensors"));
  EXPECT_TRUE(status_comes([](const json& s) { return s["sources"]["imu"]["received"] > 50; }))
      << testing::PrintToString(sensors.lines());
}

TEST_F(DdsSecurity, ViewerSeesTheNode) {
  const std::filesystem::path ours = enclaves("ours");
  Child daemon(locusd(secured(ours / "locusd")));
  const Child viewer(peer("iron", ours / "viewer"));
  EXPECT_TRUE(viewer.wait_for_line("node / locusd ")) << testing::PrintToString(viewer.lines());
}

/// An enclave from before the service had a ROS node: no permission for ros_discovery_info.
TEST_F(DdsSecurity, WithoutPermissionForTheGraphTheRestWorks) {
  const std::filesystem::path old = file("old.sh");
  std::string script = read_text(DDS_SECURITY);
  const std::string node = "/diagnostics ros_discovery_info";
  ASSERT_NE(script.find(node), std::string::npos);
  std::ofstream{old} << script.replace(script.find(node), node.size(), "/diagnostics");
  const ProgramRun made = run_program("/bin/sh", {old.string(), file("old").string(), "0"});
  ASSERT_EQ(made.status, 0) << made.err;
  const Child daemon(locusd(secured(file("old") / "locusd")));
  EXPECT_TRUE(daemon.wait_for_line("DDS is up")) << testing::PrintToString(daemon.lines());
  const Child viewer(peer("listen", file("old") / "viewer"));
  EXPECT_TRUE(viewer.wait_for_line("diagnostics ")) << testing::PrintToString(viewer.lines());
}

TEST_F(DdsSecurity, MissingFileIsNamedAndAwaited) {
  const std::filesystem::path ours = enclaves("ours"), key = ours / "locusd" / "key.pem";
  std::filesystem::rename(key, file("key.pem"));
  const Child daemon(locusd(secured(ours / "locusd")));
  EXPECT_TRUE(daemon.wait_for_line("key.pem: No such file or directory; dds.security names a folder"))
      << testing::PrintToString(daemon.lines());
  std::filesystem::rename(file("key.pem"), key);
  EXPECT_TRUE(daemon.wait_for_line("DDS is up"));
}

TEST_F(DdsSecurity, RejectedEnclaveIsNamed) {
  const std::filesystem::path ours = enclaves("ours");
  std::ofstream{ours / "locusd" / "permissions.p7s"} << "hello";
  const Child daemon(locusd(secured(ours / "locusd")));
  EXPECT_TRUE(daemon.wait_for_line("DDS did not accept the enclave " + (ours / "locusd").string()))
      << testing::PrintToString(daemon.lines());
}

} // namespace
} // namespace locus::test
