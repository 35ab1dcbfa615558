// SPDX-License-Identifier: Apache-2.0
// locusd: computes odometry from lidar packets and motion samples until stopped.
#include <chrono>
#include <cstdio>
#include <exception>
#include <string>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "config/config_yaml.hpp"
#include "config/mistyped.hpp"
#include "daemon/service/live_check.hpp"
#include "daemon/service/log.hpp"
#include "daemon/service/service.hpp"

namespace {

constexpr int kDone = 0, kFailed = 1, kWrongUsage = 2;

struct Arguments {
  std::string config;
  bool check_config = false;
  bool live = false;
  bool print_config = false;
};

void describe(CLI::App& app, Arguments& arguments) {
  app.add_option("-c,--config", arguments.config, "Configuration file; without one every key has its default")
      ->type_name("FILE");
  CLI::Option* const check =
      app.add_flag("--check-config", arguments.check_config, "Checks the configuration, prints its errors and exits");
  app.add_flag("--live", arguments.live, "With --check-config: also compares it with the traffic on the network")
      ->needs(check);
  app.add_flag("--print-config", arguments.print_config, "Prints the configuration in effect with every key and exits");
  app.set_version_flag("--version", "locusd " LOCUS_VERSION);
  app.footer("Signals: SIGHUP reloads the configuration, SIGTERM stops.\n"
             "Exit status: 0 stopped on request, 1 failed while running, 2 wrong usage or configuration.\n"
             "Examples:\n"
             "  locusd --config /etc/locusd/locusd.yaml\n"
             "  locusd --config robot.yaml --check-config --live");
}

int compare_with_network(const locus::Config& config) {
  const auto check = locus::daemon::check_live(config, std::chrono::seconds{3});
  if (!check) {
    fmt::print(stderr, "locusd: {}\n", check.error());
    return kFailed;
  }
  for (const std::string& line : check->matches)
    fmt::print("{}\n", line);
  for (const std::string& line : check->differences)
    fmt::print(stderr, "locusd: {}\n", line);
  return check->differences.empty() ? kDone : kFailed;
}

int run(const Arguments& arguments) {
  const auto config = locus::daemon::read_config(arguments.config);
  if (!config) {
    for (const std::string& error : config.error())
      fmt::print(stderr, "locusd: {}\n", error);
    return kWrongUsage;
  }
  if (arguments.print_config)
    fmt::print("{}", locus::print_config(*config));
  const int live_status = arguments.live ? compare_with_network(*config) : kDone;
  if (std::fflush(stdout) != 0) {
    fmt::print(stderr, "locusd: standard output cannot be written; check free space\n");
    return kFailed;
  }
  if (arguments.print_config || arguments.check_config)
    return live_status;
  locus::daemon::Log log;
  locus::daemon::Service service(arguments.config, log);
  return service.run(*config);
}

} // namespace

int main(int argc, char** argv) { // NOLINT(bugprone-exception-escape): exceptions while reporting an exception
  Arguments arguments;
  CLI::App app{"Real-time lidar odometry as a service.", "locusd"};
  describe(app, arguments);
  try {
    app.parse(argc, argv);
    return run(arguments);
  } catch (const CLI::Success& requested_text) {
    return app.exit(requested_text);
  } catch (const CLI::ParseError& error) {
    fmt::print(stderr, "locusd: {}\n", locus::explain(app, error));
    return kWrongUsage;
  } catch (const std::exception& error) { // out of memory or threads
    fmt::print(stderr, "locusd: {}\n", error.what());
    return kFailed;
  }
}
