// SPDX-License-Identifier: Apache-2.0
// Metrics for Prometheus, and misbehaving clients.
#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <memory>
#include <optional>
#include <regex>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>
#include <yaml-cpp/yaml.h>

#include "daemon/descriptor.hpp"
#include "daemon/machine_time.hpp"
#include "daemon/service/metrics_server.hpp"
#include "drivers/net/socket_address.hpp"
#include "service/open_metrics.hpp"
#include "service/robot_network.hpp"
#include "support/errors.hpp"
#include "support/test_drives.hpp"

namespace locus::test {
namespace {

using daemon::Descriptor;
using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr const char* kAddress = "127.0.0.1:9464";
constexpr std::string_view kScrape = "GET /metrics HTTP/1.1\r\nHost: robot\r\n\r\n";

Descriptor connect_to(const std::string& address) {
  const auto parsed = parse_socket_address(address);
  Descriptor client{::socket(parsed->storage.ss_family, SOCK_STREAM | SOCK_CLOEXEC, 0)};
  const timespec longest = daemon::to_timespec(patience());
  const timeval timeout{longest.tv_sec, 0};
  setsockopt(client.number(), SOL_SOCKET, SO_RCVTIMEO, &timeout, sizeof(timeout));
  if (connect(client.number(), reinterpret_cast<const sockaddr*>(&parsed->storage), parsed->size) != 0)
    return Descriptor{};
  return client;
}

void say(const Descriptor& client, std::string_view words) {
  static_cast<void>(::send(client.number(), words.data(), words.size(), MSG_NOSIGNAL));
}

/// Reads until the peer hangs up.
std::string hear(const Descriptor& client) {
  std::string all;
  std::array<char, 4096> bytes{};
  for (ssize_t size = 0; (size = recv(client.number(), bytes.data(), bytes.size(), 0)) > 0;)
    all.append(bytes.data(), static_cast<std::size_t>(size));
  return all;
}

std::string ask_for(std::string_view request, const std::string& address = kAddress) {
  const Descriptor client = connect_to(address);
  say(client, request);
  return hear(client);
}

std::string body_of(const std::string& answer) {
  const std::size_t end = answer.find("\r\n\r\n");
  return end == std::string::npos ? "" : answer.substr(end + 4);
}

/// Uses the host's network, because that of the test is isolated.
ProgramRun fetch_promtool() {
  return run_program("/usr/bin/nsenter", {fmt::format("--net=/proc/{}/ns/net", getppid()), FETCH_PROMTOOL, PROMTOOL});
}

/// Returns the processor time of a program, as the kernel counts it.
double cpu_s_of(const Child& program) {
  clockid_t clock{};
  EXPECT_EQ(clock_getcpuclockid(program.pid(), &clock), 0);
  return to_seconds(daemon::read_clock(clock));
}

class Metrics : public RobotNetwork {
 protected:
  [[nodiscard]] std::filesystem::path listening(const std::string& address = kAddress) const {
    return config(fmt::format("metrics: {{listen: '{}'}}\n", address));
  }

  static OpenMetrics scrape(const std::string& address = kAddress) {
    const std::string answer = ask_for(kScrape, address);
    EXPECT_TRUE(answer.starts_with("HTTP/1.1 200 OK\r\n")) << answer.substr(0, 200);
    return OpenMetrics::parse(body_of(answer));
  }

  /// Metrics between two statuses with equal input counters.
  struct Told { // NOLINT(bugprone-exception-escape): the destructor of nlohmann::json may allocate
    nlohmann::json before, after;
    OpenMetrics metrics;
  };
  /// Scrapes once the input is at rest.
  [[nodiscard]] Told told_at_rest() const {
    const auto from_outside = [](const nlohmann::json& status) {
      nlohmann::json sources = status["sources"];
      for (nlohmann::json& source : sources)
        for (const char* grows : {"heard_ms_ago", "last_used_ms_ago"})
          source.erase(grows);
      return std::pair{status["packets"], sources};
    };
    Told told;
    EXPECT_TRUE(status_comes([&](const nlohmann::json& before) {
      told.before = before;
      told.metrics = scrape();
      told.after = status();
      return from_outside(told.before) == from_outside(told.after);
    })) << told.before.dump(1)
        << told.after.dump(1);
    return told;
  }

  void reload() const {
    const ProgramRun run = ctl({"reload"});
    ASSERT_EQ(run.status, 0) << run.err;
  }

  /// Drives the robot with metrics enabled.
  void drive(const std::vector<std::string>& service, const std::vector<std::string>& player) {
    daemon_.emplace(service);
    ASSERT_TRUE(daemon_->wait_for_line("DDS is up"));
    play_.emplace(player);
    ASSERT_TRUE(daemon_->wait_for_line("tracking"));
  }

  std::optional<Child> daemon_, play_;
};

TEST_F(Metrics, MatchTheStatus) {
  ASSERT_NO_FATAL_FAILURE(drive(led_locusd(listening()), leading_play({room_drive().string()})));
  ASSERT_EQ(play_->wait_for_exit(patience_of_a_drive()), 0);
  const auto [before, status, metrics] = told_at_rest();
  EXPECT_EQ(metrics.mistakes, std::vector<std::string>{});
  EXPECT_EQ(metrics.value("locusd_build_info", {{"version", status["version"]}}), 1);
  for (const char* what : {"seen", "processed", "dropped", "failed"}) { // windows without lidar are processed, too
    EXPECT_GE(metrics.value(fmt::format("locusd_sweeps_{}_total", what)), before["sweeps"][what]) << what;
    EXPECT_LE(metrics.value(fmt::format("locusd_sweeps_{}_total", what)), status["sweeps"][what]) << what;
  }
  EXPECT_GT(metrics.value("locusd_sweeps_processed_total"), 0);
  const nlohmann::json& packets = status["packets"]["front"];
  for (const char* what : {"received", "data", "position", "lost", "reordered"})
    EXPECT_EQ(metrics.value(fmt::format("locusd_packets_{}_total", what), {{"lidar", "front"}}), packets[what]) << what;
  for (const auto& [reason, count] : packets["rejected"].items())
    EXPECT_EQ(metrics.value("locusd_packets_rejected_total", {{"lidar", "front"}, {"reason", reason}}), count);
  for (const auto& [name, source] : status["sources"].items()) {
    EXPECT_EQ(metrics.value("locusd_source_samples_received_total", {{"source", name}}), source["received"]);
    EXPECT_EQ(metrics.value("locusd_source_sweeps_used_total", {{"source", name}}), source["used_sweeps"]);
    EXPECT_NEAR(metrics.value("locusd_source_test_ratio", {{"source", name}}), source["innovation"]["test_ratio"],
                1e-4);
    for (const auto& [reason, count] : source["rejected"].items())
      EXPECT_GE(metrics.value("locusd_source_samples_rejected_total", {{"source", name}, {"reason", reason}}), 0);
    EXPECT_EQ(metrics.value("locusd_source_velocity_innovation_meters_per_second", {{"source", name}, {"axis", "y"}}),
              source["innovation"]["value"][1]);
    EXPECT_EQ(
        metrics.value("locusd_source_turn_innovation_sigma_radians_per_second", {{"source", name}, {"axis", "yaw"}}),
        source["innovation"]["sd"][5]);
  }
  const double sigma_m = metrics.value("locusd_position_sigma_meters", {{"axis", "z"}});
  EXPECT_GE(sigma_m, 0.999 * std::sqrt(before["covariance"][14].get<double>())) << "it grows in dead reckoning";
  EXPECT_LE(sigma_m, 1.001 * std::sqrt(status["covariance"][14].get<double>()));
  EXPECT_EQ(metrics.value("locusd_dds_connected"), 1);
  EXPECT_EQ(metrics.value("locusd_beginning_info", {{"from", status["beginning"]}}), 1);
  EXPECT_EQ(metrics.value("locusd_resets_total"), status["resets"]);
  EXPECT_EQ(metrics.value("locusd_flat_ground", {{"locusd_flat_ground", status["flat_ground"]}}), 1);
  double states = 0;
  for (const auto& [labels, is_it] : metrics.samples.at("locusd_state"))
    states += is_it;
  EXPECT_EQ(states, 1);
}

/// Each value lies between those of the statuses before and after it.
TEST_F(Metrics, ProcessFiguresAreTrueAndTheHistogramCoversAllSweeps) {
  const double launched_s = to_seconds(daemon::read_clock(CLOCK_REALTIME));
  ASSERT_NO_FATAL_FAILURE(drive(locusd(listening()), {LOCUS_PLAY, room_drive().string()}));
  ASSERT_EQ(play_->wait_for_exit(), 0);
  const auto [before, after, metrics] = told_at_rest();
  const auto sweeps = [](const nlohmann::json& status) {
    return status["sweeps"]["processed"].get<double>() + status["sweeps"]["failed"].get<double>();
  };
  const double count = metrics.value("locusd_sweep_process_seconds_count");
  EXPECT_GE(count, sweeps(before));
  EXPECT_LE(count, sweeps(after));
  EXPECT_EQ(metrics.samples.at("locusd_sweep_process_seconds_bucket").size(), 10U);
  const double mean_ms = 1e3 * metrics.value("locusd_sweep_process_seconds_sum") / count;
  EXPECT_LT(mean_ms, 1.01 * after["process_ms"]["max"].get<double>()) << "of fewer than 600 sweeps";
  const double more = sweeps(after) - sweeps(before), p50_ms = before["process_ms"]["p50"].get<double>();
  EXPECT_GT(mean_ms * count, 0.49 * p50_ms * sweeps(before)) << "half of them took as long";
  for (const auto& [labels, up_to] : metrics.samples.at("locusd_sweep_process_seconds_bucket")) {
    if (labels.at("le") != "+Inf" && 1e3 * std::stod(labels.at("le")) < p50_ms) {
      EXPECT_LE(up_to, 0.5 * count + 3 + more) << labels.at("le");
    }
  }
  constexpr double kCoarse_s = 2.0; // resolution of the kernel's process start time
  EXPECT_GE(metrics.value("process_start_time_seconds"), launched_s - kCoarse_s);
  EXPECT_LE(metrics.value("process_start_time_seconds"),
            to_seconds(daemon::read_clock(CLOCK_REALTIME)) - after["duration_s"].get<double>() + kCoarse_s);
  constexpr double kRounding_s = 1e-4;
  const double cpu_before_s = cpu_s_of(*daemon_), cpu_s = scrape().value("process_cpu_seconds_total");
  EXPECT_GE(cpu_s, cpu_before_s - kRounding_s);
  EXPECT_LE(cpu_s, cpu_s_of(*daemon_) + kRounding_s);
  EXPECT_LE(metrics.value("process_resident_memory_bytes"), 1.05e6 * after["peak_rss_mb"].get<double>());
  const std::filesystem::path files = fmt::format("/proc/{}/fd", daemon_->pid());
  const auto open = std::distance(std::filesystem::directory_iterator{files}, {});
  EXPECT_NEAR(metrics.value("process_open_fds"), static_cast<double>(open), 3.0);
}

/// promtool reads the older text format, which has neither infos nor state sets, and in which the counters' suffix is
/// part of the family name; the samples are identical.
TEST_F(Metrics, PassPromtool) {
  if (const ProgramRun fetched = fetch_promtool(); fetched.status != 0)
    GTEST_SKIP() << "no promtool: " << fetched.err;
  ASSERT_NO_FATAL_FAILURE(drive(locusd(listening()), endlessly(capture())));
  std::string text = body_of(ask_for(kScrape));
  text = std::regex_replace(text, std::regex{"# UNIT [^\n]*\n|# EOF\n"}, "");
  text = std::regex_replace(text, std::regex{"# TYPE (\\w+) counter\n# HELP \\w+"},
                            "# TYPE $1_total counter\n# HELP $1_total");
  text =
      std::regex_replace(text, std::regex{"# TYPE (\\w+) info\n# HELP \\w+"}, "# TYPE $1_info gauge\n# HELP $1_info");
  text = std::regex_replace(text, std::regex{" stateset\n"}, " gauge\n");
  std::ofstream{file("metrics.txt")} << text;
  const ProgramRun check =
      run_program("/bin/sh", {"-c", PROMTOOL " check metrics < " + file("metrics.txt").string() + " 2>&1"});
  EXPECT_EQ(check.status, 0) << check.out;
  EXPECT_EQ(check.out, "");
}

TEST_F(Metrics, AreServedBeforeAnySensorIsReceived) {
  const Child daemon(locusd(listening()));
  ASSERT_TRUE(daemon.wait_for_line("metrics are served at 127.0.0.1:9464"));
  const OpenMetrics metrics = scrape();
  EXPECT_EQ(metrics.mistakes, std::vector<std::string>{});
  EXPECT_EQ(metrics.value("locusd_state", {{"locusd_state", "waiting"}}), 1);
  EXPECT_EQ(metrics.value("locusd_sweep_process_seconds_count"), 0);
  EXPECT_EQ(metrics.value("locusd_source_health", {{"source", "imu"}, {"locusd_source_health", "never heard"}}), 1);
}

TEST_F(Metrics, EachFormOfAddressIsServed) {
  for (const std::string& address : {std::string{"[::1]:9464"}, file("metrics").string()}) {
    Child daemon(locusd(listening(address)));
    ASSERT_TRUE(daemon.wait_for_line("metrics are served at")) << testing::PrintToString(daemon.lines());
    EXPECT_EQ(scrape(address).mistakes, std::vector<std::string>{}) << address;
    daemon.signal(SIGTERM);
    ASSERT_EQ(daemon.wait_for_exit(), 0);
  }
  EXPECT_FALSE(std::filesystem::exists(file("metrics")));
}

TEST_F(Metrics, StaleSocketIsReplacedAndAFileIsNot) {
  for (const int end : {SIGKILL, SIGTERM}) {
    Child daemon(locusd(listening(file("metrics").string())));
    ASSERT_TRUE(daemon.wait_for_line("metrics are served at")) << testing::PrintToString(daemon.lines());
    daemon.signal(end);
    ASSERT_TRUE(daemon.wait_for_exit());
  }
  std::ofstream{file("metrics")} << "of somebody";
  const Child daemon(locusd(listening(file("metrics").string())));
  EXPECT_TRUE(daemon.wait_for_line("the service runs without metrics"));
  EXPECT_EQ(read_text(file("metrics")), "of somebody");
}

TEST_F(Metrics, InvalidAddressesAreRejectedWithTheSyntax) {
  for (const char* address : {"9464", "localhost:9464", "127.0.0.1", "127.0.0.1:0", "127.0.0.1:65536", "::1:9464",
                              "[::1]", "unix:/run/x", "run/x", "/run/", "127.0.0.1:94 64", "0x7f.1:80", ":9464"}) {
    const ProgramRun run = run_program(LOCUSD, {"--config", listening(address).string(), "--check-config"});
    EXPECT_EQ(run.status, 2) << address;
    EXPECT_TRUE(contains(run.err, "metrics.listen")) << address << run.err;
    EXPECT_TRUE(contains(run.err, "write IPv4:PORT as 127.0.0.1:9464")) << address << run.err;
  }
  const std::string longest = "/" + std::string(106, 'a');
  EXPECT_TRUE(parse_socket_address(longest));
  EXPECT_FALSE(parse_socket_address(longest + 'a'));
}

TEST_F(Metrics, PortInUseIsReportedAndTheServiceContinues) {
  const auto taken = daemon::MetricsServer::open(kAddress, [] { return std::string{}; });
  ASSERT_TRUE(taken) << taken.error();
  const Child daemon(locusd(listening()));
  EXPECT_TRUE(daemon.wait_for_line("metrics.listen 127.0.0.1:9464: Address already in use; the service runs without"))
      << testing::PrintToString(daemon.lines());
  EXPECT_EQ(status()["state"], "waiting");
}

TEST_F(Metrics, SocketOfAnotherKindIsNotReplaced) {
  const Child daemon(locusd(listening(control().string())));
  EXPECT_TRUE(daemon.wait_for_line("control: Address already in use; the service runs without metrics"))
      << testing::PrintToString(daemon.lines());
  EXPECT_EQ(status()["state"], "waiting");
}

/// Exhausts the file descriptors of a process for its lifetime.
class NoDescriptorLeft {
 public:
  explicit NoDescriptorLeft(pid_t process) : process_(process) {
    EXPECT_EQ(prlimit(process, RLIMIT_NOFILE, nullptr, &before_), 0);
    rlimit none{0, before_.rlim_max};
    while (std::filesystem::exists(fmt::format("/proc/{}/fd/{}", process, none.rlim_cur)))
      ++none.rlim_cur; // the next one to be allocated
    EXPECT_EQ(prlimit(process, RLIMIT_NOFILE, &none, nullptr), 0);
  }
  ~NoDescriptorLeft() { EXPECT_EQ(prlimit(process_, RLIMIT_NOFILE, &before_, nullptr), 0); }
  NoDescriptorLeft(const NoDescriptorLeft&) = delete;
  NoDescriptorLeft& operator=(const NoDescriptorLeft&) = delete;

 private:
  pid_t process_;
  rlimit before_{};
};

/// Clients are not served while no descriptor is left; the main thread does not spin on that.
TEST_F(Metrics, LackOfDescriptorsCostsNoCpu) {
  const Child daemon(locusd(listening()));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  {
    const NoDescriptorLeft none(daemon.pid());
    const Descriptor metrics = connect_to(kAddress);
    const Child caller({LOCUSCTL, "--socket", control().string(), "status"});
    std::this_thread::sleep_for(milliseconds{500});
    const double at_first_s = cpu_s_of(daemon);
    std::this_thread::sleep_for(seconds{2});
    EXPECT_LT(cpu_s_of(daemon) - at_first_s, 0.5) << "of two seconds";
  }
  EXPECT_EQ(scrape().mistakes, std::vector<std::string>{}) << testing::PrintToString(daemon.lines());
}

TEST_F(Metrics, ReloadSwitchesThemOnAndOff) {
  const Child daemon(locusd(config()));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  for (int turn = 0; turn < 2; ++turn) {
    EXPECT_LT(connect_to(kAddress).number(), 0);
    static_cast<void>(listening());
    ASSERT_NO_FATAL_FAILURE(reload());
    EXPECT_EQ(scrape().mistakes, std::vector<std::string>{});
    ASSERT_NO_FATAL_FAILURE(reload());
    EXPECT_EQ(scrape().mistakes, std::vector<std::string>{}) << "it stays";
    static_cast<void>(config());
    ASSERT_NO_FATAL_FAILURE(reload());
  }
  EXPECT_LT(connect_to(kAddress).number(), 0);
}

TEST_F(Metrics, InvalidRequestsAreAnsweredWithTheError) {
  const Child daemon(locusd(listening()));
  ASSERT_TRUE(daemon.wait_for_line("metrics are served"));
  const auto first_line = [](std::string_view request) {
    const std::string answer = ask_for(request);
    return answer.substr(0, answer.find("\r\n"));
  };
  const std::string ok = "HTTP/1.1 200 OK", bad = "HTTP/1.1 400 Bad Request", none = "HTTP/1.1 404 Not Found",
                    not_allowed = "HTTP/1.1 405 Method Not Allowed";
  EXPECT_EQ(first_line(kScrape), ok);
  EXPECT_EQ(first_line("GET /metrics?x=1 HTTP/1.0\r\n\r\n"), ok);
  const std::string head = ask_for("HEAD /metrics HTTP/1.1\r\n\r\n");
  EXPECT_TRUE(head.starts_with(ok) && head.ends_with("\r\n\r\n")) << head;
  EXPECT_NE(head.find("Content-Length: "), std::string::npos) << head;
  EXPECT_EQ(head.find("# TYPE"), std::string::npos) << head;
  EXPECT_EQ(first_line("GET / HTTP/1.1\r\n\r\n"), none);
  EXPECT_EQ(first_line("GET /metrics/../../etc/passwd HTTP/1.1\r\n\r\n"), none);
  EXPECT_EQ(first_line("POST /metrics HTTP/1.1\r\n\r\n"), not_allowed);
  EXPECT_EQ(first_line("GET /metrics\r\n\r\n"), bad);
  EXPECT_EQ(first_line("GET /metrics HTTP/2\r\n\r\n"), bad);
  EXPECT_EQ(first_line("\r\n\r\n"), bad);
  EXPECT_EQ(first_line(std::string(9, '\0') + "\xff\xfe \r\n\r\n"), bad);
  EXPECT_EQ(first_line(std::string(daemon::HttpServer::kMaxRequestBytes + 1, 'A')), bad);
  EXPECT_EQ(first_line("GET /metrics HTTP/1.1\r\nCookie: " + std::string(daemon::HttpServer::kMaxRequestBytes, 'A')),
            bad);
  EXPECT_EQ(ask_for(kScrape).substr(0, 120).find("Content-Type: application/openmetrics-text; version=1.0.0; "
                                                 "charset=utf-8\r\n"),
            ok.size() + 2);
}

TEST_F(Metrics, SilentClientBlocksNoOther) {
  const Child daemon(locusd(listening()));
  ASSERT_TRUE(daemon.wait_for_line("metrics are served"));
  std::vector<Descriptor> silent;
  for (std::size_t i = 0; i < daemon::HttpServer::kMaxClients + 4; ++i) {
    silent.push_back(connect_to(kAddress));
    ASSERT_GE(silent.back().number(), 0) << i;
    say(silent.back(), "GET /metr");
  }
  EXPECT_EQ(scrape().mistakes, std::vector<std::string>{});
  EXPECT_EQ(status()["state"], "waiting");
  EXPECT_EQ(hear(silent.back()), "") << "in the end it is hung up on";
}

/// A server driven by the test, with simulated time.
class MetricsServerTest : public RobotNetwork {
 protected:
  void SetUp() override {
    RobotNetwork::SetUp();
    if (IsSkipped() || HasFatalFailure())
      return;
    auto server = daemon::MetricsServer::open(
        kAddress, [] { return std::string{"# EOF\n"}; }, [](clockid_t /*clock*/) { return now_; });
    ASSERT_TRUE(server) << server.error();
    server_ = std::move(*server);
  }

  /// Returns an accepted client.
  Descriptor client() {
    Descriptor client = connect_to(kAddress);
    EXPECT_GE(client.number(), 0);
    EXPECT_TRUE(serve_until([this] { return server_->serve(); }));
    return client;
  }

  static bool serve_until(const std::function<bool()>& holds) {
    const auto give_up = std::chrono::steady_clock::now() + patience();
    while (!holds())
      if (std::chrono::steady_clock::now() > give_up)
        return false;
    return true;
  }

  /// Returns everything the server sends until it hangs up.
  std::string served(const Descriptor& client) {
    std::string all;
    EXPECT_TRUE(serve_until([&] {
      server_->serve();
      std::array<char, 4096> bytes{};
      const ssize_t size = recv(client.number(), bytes.data(), bytes.size(), MSG_DONTWAIT);
      if (size > 0)
        all.append(bytes.data(), static_cast<std::size_t>(size));
      return size == 0 || (size < 0 && errno == ECONNRESET);
    }));
    return all;
  }

  [[nodiscard]] static bool is_connected(const Descriptor& client) {
    char byte = 0;
    return recv(client.number(), &byte, 1, MSG_DONTWAIT | MSG_PEEK) < 0 && errno == EAGAIN;
  }

  static inline Duration now_ = std::chrono::hours{1};
  std::unique_ptr<daemon::MetricsServer> server_;
};

TEST_F(MetricsServerTest, ServesDespiteAnyNumberOfSilentClients) {
  std::vector<Descriptor> silent;
  for (int i = 0; i < 100; ++i) {
    silent.push_back(client());
    say(silent.back(), "GET /metr");
  }
  const Descriptor asks = connect_to(kAddress);
  say(asks, kScrape);
  EXPECT_TRUE(served(asks).ends_with("# EOF\n"));
  const Descriptor deaf = client();
  for (int i = 0; i < 100; ++i) // excess requests of a client that does not read must not fill memory
    say(deaf, kScrape);
  const Descriptor next = connect_to(kAddress);
  say(next, kScrape);
  EXPECT_TRUE(served(next).ends_with("# EOF\n"));
}

/// A request that arrives byte by byte is served if it is complete before the timeout.
TEST_F(MetricsServerTest, ServesSlowClientsWithinTheTimeout) {
  const Descriptor slow = client();
  for (const char letter : kScrape) {
    say(slow, {&letter, 1});
    now_ += daemon::HttpServer::kPatience / kScrape.size();
    server_->serve();
  }
  EXPECT_TRUE(served(slow).ends_with("# EOF\n"));
}

TEST_F(MetricsServerTest, DropsClientsSilentBeyondTheTimeout) {
  const Descriptor loris = client();
  now_ += daemon::HttpServer::kPatience;
  EXPECT_FALSE(server_->serve());
  EXPECT_TRUE(is_connected(loris));
  now_ += Duration{1};
  EXPECT_TRUE(server_->serve());
  EXPECT_EQ(served(loris), "");
}

/// The caller of serve() pauses after it, and does not spin while a client waits that cannot be accepted.
TEST_F(MetricsServerTest, ServesClientsAfterALackOfDescriptors) {
  const Descriptor client = connect_to(kAddress);
  say(client, kScrape);
  bool says_so = true;
  {
    const NoDescriptorLeft none(getpid());
    for (int i = 0; i < 10; ++i)
      says_so = server_->serve() && says_so;
  }
  EXPECT_TRUE(says_so);
  EXPECT_TRUE(is_connected(client));
  EXPECT_TRUE(served(client).ends_with("# EOF\n"));
}

/// The parser of these tests detects errors.
TEST(OpenMetricsReader, RejectsInvalidText) {
  const std::string good = "# TYPE a counter\n# HELP a b\na_total{x=\"1\"} 1\n# EOF\n";
  EXPECT_EQ(OpenMetrics::parse(good).mistakes, std::vector<std::string>{});
  const auto with = [&](const std::string& part, const std::string& other) {
    std::string text = good;
    return text.replace(text.find(part), part.size(), other);
  };
  for (const std::string& bad : {with("# EOF\n", ""),
                                 with("# EOF\n", "# EOF\n\n"),
                                 with("a_total", "a"),
                                 with("a_total", "b_total"),
                                 with(" 1\n", " -1\n"),
                                 with(" 1\n", " NaN\n"),
                                 with(" 1\n", " nan\n"),
                                 with(" 1\n", "\n"),
                                 with("counter", "info"),
                                 with("counter", "stateset"),
                                 with("counter", "histogram"),
                                 with("counter", "counts"),
                                 with("# HELP a b\n", ""),
                                 with("# HELP", "# UNIT"),
                                 with("x=\"1\"", "x=\"1\","),
                                 with("x=\"1\"", "x=1"),
                                 with("x=\"1\"", "x=\"1\",x=\"2\""),
                                 with("# EOF", "a_total{x=\"1\"} 1\n# EOF"),
                                 with("# EOF", "# HELP a b\n# EOF"),
                                 with("# EOF", "# TYPE b gauge\n# EOF"),
                                 std::string{}})
    EXPECT_NE(OpenMetrics::parse(bad).mistakes.size(), 0U) << bad;
}

/// The installed rules and dashboard refer to existing metrics.
class Examples : public Metrics {
 protected:
  static std::string example(const std::string& name) { return std::string{EXAMPLES} + "/" + name; }

  /// Expects each metric named in the expression to exist.
  static void expect_known(const OpenMetrics& metrics, std::string expression) {
    const std::string whole = expression;
    std::smatch found;
    for (const std::regex selector{R"((\w+)\{([^}]*)\})"}; std::regex_search(expression, found, selector);) {
      const std::string name = found[1], inside = found[2];
      expect_labels(metrics, name, inside, whole);
      expression = found.prefix().str() + name + found.suffix().str();
    }
    expression = std::regex_replace(expression, std::regex{R"(\[[^\]]*\]| *\b(by|without) *\([^)]*\) *)"}, "");
    const std::regex word{R"([A-Za-z_:]\w*(?![\w(]))"};
    int count = 0;
    for (std::sregex_iterator name{expression.begin(), expression.end(), word}, end; name != end; ++name) {
      if (name->str() == "or" || name->str() == "and" || name->str() == "e")
        continue;
      ++count;
      EXPECT_TRUE(name->str() == "up" || metrics.samples.contains(name->str())) << name->str() << " in " << whole;
    }
    EXPECT_GT(count, 0) << whole;
  }

  static void expect_labels(const OpenMetrics& metrics, const std::string& name, const std::string& inside,
                            const std::string& whole) {
    const std::regex matcher{R"re((\w+)(=|=~)"([^"]*)")re"};
    for (std::sregex_iterator label{inside.begin(), inside.end(), matcher}, end; label != end; ++label) {
      const std::string key = (*label)[1], text = (*label)[3];
      if (key == "instance" || key == "job" || name == "up")
        continue;
      const auto family = metrics.samples.find(name);
      ASSERT_NE(family, metrics.samples.end()) << whole;
      EXPECT_TRUE(std::ranges::any_of(
          family->second,
          [&](const auto& sample) { return sample.first.contains(key) && sample.first.at(key) == text; }))
          << key << '=' << text << " in " << whole;
    }
  }

  /// Scrapes with recording enabled, so that all metrics are present.
  OpenMetrics all_metrics() {
    daemon_.emplace(locusd(config(
        fmt::format("metrics: {{listen: '{}'}}\nrecord: {{folder: record, max_bytes: 100000000}}\n", kAddress))));
    EXPECT_TRUE(daemon_->wait_for_line("DDS is up"));
    play_.emplace(endlessly(capture()));
    EXPECT_TRUE(daemon_->wait_for_line("tracking"));
    EXPECT_TRUE(status_comes([](const nlohmann::json& status) {
      return status["sweeps"]["processed"] > 10 && status["recording"]["recorded"] > 0;
    }));
    return scrape();
  }
};

TEST_F(Examples, UseExistingMetricsAndLabels) {
  const OpenMetrics metrics = all_metrics();
  EXPECT_EQ(metrics.mistakes, std::vector<std::string>{});
  int rules = 0, targets = 0;
  for (const auto& group : YAML::LoadFile(example("prometheus-alerts.yaml"))["groups"])
    for (const auto& rule : group["rules"]) {
      ++rules;
      expect_known(metrics, rule["expr"].as<std::string>());
    }
  const nlohmann::json dashboard = nlohmann::json::parse(read_text(example("grafana-dashboard.json")));
  for (const auto& panel : dashboard["panels"])
    for (const auto& target : panel["targets"]) {
      ++targets;
      expect_known(metrics, target["expr"]);
    }
  EXPECT_GE(rules, 10);
  EXPECT_GE(targets, 15);
  EXPECT_TRUE(metrics.samples.contains("locusd_build_info")) << "the dashboard finds the robots by it";
}

TEST_F(Examples, AlertsFireWhenTheyShould) {
  if (const ProgramRun fetched = fetch_promtool(); fetched.status != 0)
    GTEST_SKIP() << "no promtool: " << fetched.err;
  std::filesystem::copy_file(example("prometheus-alerts.yaml"), file("prometheus-alerts.yaml"));
  std::filesystem::copy_file(ALERTS_TEST, file("alerts_test.yaml"));
  const ProgramRun check = run_program(PROMTOOL, {"check", "rules", file("prometheus-alerts.yaml")});
  EXPECT_EQ(check.status, 0) << check.out << check.err;
  const ProgramRun test = run_program(PROMTOOL, {"test", "rules", file("alerts_test.yaml")});
  EXPECT_EQ(test.status, 0) << test.out << test.err;
}

} // namespace
} // namespace locus::test
