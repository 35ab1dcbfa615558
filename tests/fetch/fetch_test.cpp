// SPDX-License-Identifier: Apache-2.0
// Fetching from simulated lidars over real sockets of this host.
#include "fetch/fetch.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <string>
#include <string_view>

#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <unistd.h>

#include "drivers/lidar_input.hpp"
#include "fetch/tcp_server.hpp"
#include "locus_sim/ouster_sensor.hpp"
#include "support/child.hpp"
#include "support/patience.hpp"
#include "support/temporary_folder.hpp"

namespace locus::tools {
namespace {

using test::TcpPort;
using test::TcpServer;

std::string metadata_text() {
  sim::SyntheticLidarOptions options;
  options.model = sim::OusterModel::os1_32;
  return sim::OusterSensor(options, Stamp{}).metadata_text();
}

std::string angles_text() {
  std::string text = "Laser id,Elevation,Azimuth\n";
  for (int laser = 1; laser <= 32; ++laser)
    text += fmt::format("{},{:.3f},{:.3f}\n", laser, 16.0 - laser, 0.01 * laser);
  return text;
}

std::string http(std::string_view body, std::string_view status = "200 OK") {
  return fmt::format("HTTP/1.1 {}\r\nContent-Type: application/json\r\nCONTENT-LENGTH: {}\r\n\r\n{}", status,
                     body.size(), body);
}

/// A Hesai answer that claims this many bytes.
std::string ptc(std::string_view body, std::size_t bytes, char code = 0) {
  std::string text{"\x47\x74\x05", 3};
  text += code;
  for (int shift = 24; shift >= 0; shift -= 8)
    text += static_cast<char>(bytes >> shift);
  return text.append(body);
}
std::string ptc(std::string_view body) { return ptc(body, body.size()); }

/// Always gives the same answer.
TcpServer::Answer always(std::string answer) {
  return [answer = std::move(answer)](const std::string&) { return answer; };
}
std::optional<std::string> silent(const std::string&) { return std::nullopt; }

/// The three servers of a lidar, on ports of this host.
struct Lidar {
  TcpPort http, commands, hesai;

  [[nodiscard]] Expected<SensorFile, std::string> fetch(std::chrono::milliseconds patience) const {
    return fetch_sensor_file("127.0.0.1", {http.number(), commands.number(), hesai.number(), patience});
  }
};

class Fetch : public testing::Test {
 protected:
  Expected<SensorFile, std::string> fetch() { return lidar_.fetch(patience_); }
  void expect_problem(const std::string& what) {
    const auto file = fetch();
    ASSERT_FALSE(file);
    EXPECT_NE(file.error().find(what), std::string::npos) << file.error();
  }

  Lidar lidar_;
  TcpPort &http_ = lidar_.http, &commands_ = lidar_.commands, &hesai_ = lidar_.hesai;
  std::chrono::milliseconds patience_ = std::chrono::duration_cast<std::chrono::milliseconds>(test::patience());
};

TEST_F(Fetch, ReadsOusterMetadataOverHttp) {
  TcpServer server(http_, [](const std::string& question) -> std::optional<std::string> {
    return question.starts_with("GET /api/v1/sensor/metadata HTTP/1.0\r\n") ? http(metadata_text())
                                                                            : http("", "400 Bad Request");
  });
  const auto file = fetch();
  ASSERT_TRUE(file) << file.error();
  EXPECT_EQ(file->text, metadata_text()) << "as it came";
  EXPECT_EQ(std::get<ouster::Metadata>(file->content).pixels_per_column, 32U);
}

TEST_F(Fetch, JoinsAnswersInSeveralSegments) {
  {
    TcpServer server(http_, always(http(metadata_text())), {.piece_bytes = 97});
    const auto file = fetch();
    ASSERT_TRUE(file) << file.error();
    EXPECT_EQ(file->text, metadata_text());
  }
  TcpServer server(hesai_, always(ptc(angles_text())), {.piece_bytes = 3, .hangs_up = false});
  const auto file = fetch();
  ASSERT_TRUE(file) << file.error();
  EXPECT_EQ(file->text, angles_text());
}

TEST_F(Fetch, ReadsHttpAnswersWithoutLengthToTheEndOfTheConnection) {
  TcpServer server(http_, always("HTTP/1.0 200 OK\r\n\r\n" + metadata_text()), {.piece_bytes = 500});
  const auto file = fetch();
  ASSERT_TRUE(file) << file.error();
  EXPECT_EQ(file->text, metadata_text());
}

TEST_F(Fetch, JoinsHttpChunks) {
  const std::string text = metadata_text(), head = "HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n";
  std::string chunks = head;
  for (std::size_t at = 0; at < text.size(); at += 1000) {
    const std::string piece = text.substr(at, 1000);
    chunks += fmt::format("{:x}\r\n{}\r\n", piece.size(), piece);
  }
  const TcpServer server(http_, always(chunks + "0\r\n\r\n"));
  const auto file = fetch();
  ASSERT_TRUE(file) << file.error();
  EXPECT_EQ(file->text, text);
}

TEST_F(Fetch, RejectsAnswersCutBetweenChunks) {
  const std::string head = "HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n";
  for (const std::string rest : {"", "3e8\r\n{", "ffffffffffff\r\n{", "x\r\n", "10000000000000000\r\n{}\r\n"}) {
    Lidar lidar;
    const TcpServer server(lidar.http, always(head + rest));
    const auto file = lidar.fetch(patience_);
    ASSERT_FALSE(file) << rest;
    EXPECT_NE(file.error().find("the answer ends between its chunks"), std::string::npos) << file.error();
  }
}

TEST_F(Fetch, ReadsMetadataOfOldFirmwareInParts) {
  const auto parts = nlohmann::json::parse(metadata_text());
  const auto answer = [&](const std::string& question) -> std::optional<std::string> {
    if (question == "get_config_param active\n")
      return parts["config_params"].dump() + "\n";
    const std::string part = question.substr(4, question.size() - 5);
    const bool is_known = parts.contains(part) && part != "calibration_status"; // as of firmware 2.0
    return is_known ? parts[part].dump() + "\n" : "error: Command not recognized.\n";
  };
  TcpServer web_page(http_, always(http("", "404 Not Found")));
  TcpServer server(commands_, answer, {.piece_bytes = 50, .hangs_up = false});
  const auto file = fetch();
  ASSERT_TRUE(file) << file.error();
  EXPECT_EQ(nlohmann::json::parse(file->text)["beam_intrinsics"], parts["beam_intrinsics"]);
  EXPECT_EQ(nlohmann::json::parse(file->text)["calibration_status"], "error: Command not recognized.");
  EXPECT_EQ(std::get<ouster::Metadata>(file->content).columns_per_frame, 1024U);
}

TEST_F(Fetch, ReadsHesaiAngles) {
  TcpServer server(hesai_, [](const std::string& question) -> std::optional<std::string> {
    return question == std::string{"\x47\x74\x05\0\0\0\0\0", 8} ? ptc(angles_text()) : ptc("", 0, 2);
  });
  const auto file = fetch();
  ASSERT_TRUE(file) << file.error();
  EXPECT_EQ(file->text, angles_text());
  EXPECT_EQ(std::get<hesai::Calibration>(file->content).laser_count, 32U);
}

TEST_F(Fetch, RejectsTruncatedAnswers) {
  const std::string page = http(metadata_text()), angles = angles_text();
  const std::string angles_size = fmt::format("after {} of {} bytes", 8 + angles.size(), 9 + angles.size());
  struct Case {
    TcpPort Lidar::*port;
    std::string answer, problem;
  };
  for (const Case& broken : {Case{&Lidar::http, page.substr(0, page.size() - 10), "the answer ends after"},
                             Case{&Lidar::http, "HTTP/1.1 200 OK\r\nConte", "the answer is not HTTP"},
                             Case{&Lidar::http, "HTTP/1.1 200 OK\r\n\r\n{", "its metadata: is no JSON"},
                             Case{&Lidar::commands, R"({"prod_line": )", "the answer to get_sensor_info is truncated"},
                             Case{&Lidar::hesai, ptc(angles, angles.size() + 1), angles_size},
                             Case{&Lidar::hesai, "\x47\x74", "the answer is not that of a Hesai"}}) {
    Lidar lidar;
    TcpServer server(lidar.*broken.port, always(broken.answer));
    const auto file = lidar.fetch(patience_);
    ASSERT_FALSE(file);
    EXPECT_NE(file.error().find(broken.problem), std::string::npos) << file.error();
  }
}

TEST_F(Fetch, RejectsAbsurdLengths) {
  TcpServer web(http_, always("HTTP/1.1 200 OK\r\nContent-Length: 99999999999\r\n\r\n{"), {.hangs_up = false});
  TcpServer commands(commands_, always(std::string(2'000'000, ' ')), {.hangs_up = false});
  TcpServer hesai(hesai_, always(ptc("", 0xFFFFFFFF)), {.hangs_up = false});
  const auto file = fetch();
  ASSERT_FALSE(file);
  for (const std::string reason :
       {"announces 99999999999 bytes", "longer than 1000000 bytes", "announces 4294967303 bytes"})
    EXPECT_NE(file.error().find(reason), std::string::npos) << file.error();
}

TEST_F(Fetch, ReportsTheErrorOfTheLidar) {
  TcpServer web(http_, always(http("{}", "503 Service Unavailable")), {.hangs_up = false});
  TcpServer hesai(hesai_, always(ptc("", 0, 7)), {.hangs_up = false});
  const auto file = fetch();
  ASSERT_FALSE(file);
  EXPECT_NE(file.error().find("answers with HTTP status 503"), std::string::npos) << file.error();
  EXPECT_NE(file.error().find("refuses to send its angles, with code 7"), std::string::npos) << file.error();
}

TEST_F(Fetch, SilenceEndsAtTheTimeout) {
  patience_ = std::chrono::milliseconds{200};
  TcpServer web(http_, silent), commands(commands_, silent), hesai(hesai_, silent);
  const auto before = std::chrono::steady_clock::now();
  expect_problem("no answer in time");
  EXPECT_GE(std::chrono::steady_clock::now() - before, 3 * patience_);
}

TEST_F(Fetch, SlowAnswersEndAtTheTimeout) {
  patience_ = std::chrono::milliseconds{200};
  TcpServer web(http_, always(std::string(100'000, 'x')), {.piece_bytes = 1}); // 20 s for all of it
  expect_problem("no answer in time");
}

TEST_F(Fetch, RejectsAnswersOfOtherDevices) {
  TcpServer web(http_, always(http("<html>a printer</html>")));
  TcpServer commands(commands_, always("\x1b[2JSSH-2.0\n"), {.hangs_up = false});
  TcpServer hesai(hesai_, always(ptc("a,b,c\n")));
  const auto file = fetch();
  ASSERT_FALSE(file);
  for (const std::string reason : {"its metadata: is no JSON", "its metadata: sensor_info: this section is missing",
                                   "its angles:1: \"Laser id,Elevation,Azimuth\" is expected"})
    EXPECT_NE(file.error().find(reason), std::string::npos) << file.error();
  EXPECT_EQ(file.error().find('\x1b'), std::string::npos) << "the terminal stays as it is";
}

TEST_F(Fetch, RejectsOtherVersionsOfTheHesaiProtocol) {
  TcpServer server(hesai_, always("\x57\x75\x01\x05" + std::string(8, '\0')));
  expect_problem("the answer is not that of a Hesai");
}

TEST_F(Fetch, NamesEachClosedPort) {
  for (const TcpPort* port : {&http_, &commands_, &hesai_})
    expect_problem(fmt::format("TCP port {}: Connection refused", port->number()));
  expect_problem("check its power, cable and address");
}

TEST_F(Fetch, ReportsInvalidAddresses) {
  for (const std::string text : {"os-122.local", "", "192.168.1", "/run/socket", "1.2.3.4:80"}) {
    const auto file = fetch_sensor_file(text);
    ASSERT_FALSE(file) << text;
    EXPECT_NE(file.error().find("not an address; name that of the lidar"), std::string::npos) << file.error();
  }
}

/// The program, which uses the lidars' standard ports, on an address in the test's own network.
class FetchProgram : public testing::Test {
 protected:
  FetchProgram() : address_(fmt::format("127.{}.{}.9", 1 + getpid() / 250 % 250, 1 + getpid() % 250)) {}

  /// Returns its exit status and output.
  std::pair<int, std::string> run(const std::filesystem::path& file) const {
    test::Child program({LOCUSCTL, "fetch", address_, "-o", file.string()});
    const auto status = program.wait_for_exit();
    std::string text;
    for (const std::string& line : program.lines())
      text += line + "\n";
    return {status.value_or(-1), text};
  }
  static std::string content(const std::filesystem::path& file) {
    std::ifstream stream{file};
    return {std::istreambuf_iterator<char>{stream}, {}};
  }

  test::TemporaryFolder folder_;
  std::string address_;
};

TEST_F(FetchProgram, WritesTheFileNamedInItsYaml) {
  TcpPort port(address_, 9347);
  TcpServer server(port, always(ptc(angles_text())));
  const auto file = folder_ / "front.csv";
  const auto [status, text] = run(file);
  EXPECT_EQ(status, 0) << text;
  EXPECT_NE(text.find("angles of the 32 lasers of a Hesai"), std::string::npos) << text;
  EXPECT_NE(
      text.find(fmt::format("- {{name: lidar1, model: auto, calibration: {}, ", file.lexically_normal().string())),
      std::string::npos)
      << text;
  EXPECT_EQ(content(file), angles_text());
  LidarOptions options;
  options.calibration = file.string();
  EXPECT_TRUE(LidarInput::open(options, 0));
}

TEST_F(FetchProgram, WritesTheMetadataOfAnOuster) {
  const auto parts = nlohmann::json::parse(metadata_text());
  TcpPort port(address_, 7501);
  TcpServer server(port,
                   [&](const std::string& question) -> std::optional<std::string> {
                     const bool is_config = question.starts_with("get_config_param");
                     return parts.at(is_config ? "config_params" : question.substr(4, question.size() - 5)).dump() +
                            "\n";
                   },
                   {.hangs_up = false});
  const auto file = folder_ / "front.json";
  const auto [status, text] = run(file);
  EXPECT_EQ(status, 0) << text;
  EXPECT_NE(text.find("metadata of an OS1-32, serial number"), std::string::npos) << text;
  EXPECT_NE(text.find(fmt::format("model: Ouster, metadata: {}, ", file.lexically_normal().string())),
            std::string::npos)
      << text;
  EXPECT_TRUE(ouster::read_metadata(file));
}

TEST_F(FetchProgram, FailureLeavesTheExistingFile) {
  const auto file = folder_ / "front.csv";
  std::ofstream{file} << "before";
  const auto [status, text] = run(file);
  EXPECT_EQ(status, 1);
  EXPECT_NE(text.find("locusctl:   Hesai, TCP port 9347: Connection refused"), std::string::npos) << text;
  EXPECT_EQ(content(file), "before");
}

TEST_F(FetchProgram, UnwritableFileIsNamed) {
  TcpPort port(address_, 9347);
  TcpServer server(port, always(ptc(angles_text())));
  const auto [status, text] = run(folder_ / "none/front.csv");
  EXPECT_EQ(status, 1);
  EXPECT_NE(text.find("none/front.csv: cannot be written (No such file or directory)"), std::string::npos) << text;
  const auto [wrong, hint] = run(folder_ / "front.yaml");
  EXPECT_EQ(wrong, 2);
  EXPECT_NE(hint.find("front.yaml: its name must end in .csv"), std::string::npos) << hint;
}

} // namespace
} // namespace locus::tools
