// SPDX-License-Identifier: Apache-2.0
// locusctl: controls a running locusd.
#include <charconv>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <system_error>
#include <thread>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "command_line.hpp"
#include "config/config.hpp"
#include "core/base/options.hpp"
#include "daemon/calibration.hpp"
#include "locus_replay/failure.hpp"
#include "locus_replay/map_file.hpp"
#include "locusctl/fetch_command.hpp"
#include "locusctl/screen.hpp"
#include "locusctl/sensors.hpp"
#include "locusctl/service_client.hpp"
#include "locusctl/view/view_command.hpp"

namespace locus::tools {
namespace {

using Json = nlohmann::ordered_json;

struct CtlArguments {
  std::string instance, socket, mode, address, file, keep;
  std::vector<double> pose;
  std::uint16_t port = kViewPort;
  DdsOptions dds; ///< network of the ROS 2 nodes
  bool json = false, watch = false, yaml = false;

  [[nodiscard]] std::filesystem::path control() const {
    if (!socket.empty())
      return socket;
    return "/run/locusd" + (instance.empty() ? "" : "@" + instance) + "/control";
  }
};

std::string status_text(const CtlArguments& arguments) {
  return send_request(arguments.control(), {{"command", "status"}, {"text", true}}).json.value("text", "");
}

void watch(const CtlArguments& arguments) {
  Screen screen;
  do {
    try {
      screen.show(status_text(arguments));
    } catch (const Failure& failure) { // the service may return
      screen.show(failure.what());
    }
  } while (!screen.wait_for_end(std::chrono::milliseconds{500}));
}

void status(const CtlArguments& arguments) {
  if (arguments.watch)
    return watch(arguments);
  fmt::print("{}", arguments.json ? send_request(arguments.control(), {{"command", "status"}}).json.dump(1) + '\n'
                                  : status_text(arguments));
}

void save_map(const CtlArguments& arguments) {
  const std::vector<std::byte> bytes = send_request(arguments.control(), {{"command", "save-map"}}).bytes;
  std::vector<SurfacePoint> points(bytes.size() / sizeof(SurfacePoint));
  if (!points.empty())
    std::memcpy(std::as_writable_bytes(std::span(points)).data(), bytes.data(), points.size() * sizeof(SurfacePoint));
  write_map(arguments.file, points);
  fmt::print("{}: {} points\n", arguments.file, points.size());
}

void reset(const CtlArguments& arguments) {
  Json request{{"command", "reset"}};
  if (!arguments.pose.empty())
    request["pose"] = arguments.pose;
  send_request(arguments.control(), request);
}

/// Prints the estimated calibration of the motion sources and lidars, or the configuration with it.
void calibration(const CtlArguments& arguments) {
  const Json status = send_request(arguments.control(), {{"command", "status"}}).json;
  const Json sources = status.value("sources", Json::object()), lidars = status.value("lidars", Json::object());
  fmt::print("{}",
             arguments.yaml ? daemon::calibration_yaml(sources, lidars) : daemon::calibration_text(sources, lidars));
}

/// Requests that an incident be recorded, and waits until it is written: the service answers earlier.
void record(const CtlArguments& arguments) {
  double keep_s = 0;
  const char* const end = arguments.keep.data() + arguments.keep.size();
  const auto [stopped, error] = std::from_chars(arguments.keep.data(), end, keep_s);
  if (const std::string_view unit{stopped, end};
      error != std::errc{} || !std::isfinite(keep_s) || (unit != "s" && !unit.empty()))
    throw Failure(ExitStatus::wrong_usage, fmt::format("--keep {}: must be seconds, e.g. 60s", arguments.keep));
  const Json answer = send_request(arguments.control(), {{"command", "record"}, {"keep_s", keep_s}}).json;
  const std::string folder = answer.value("folder", "");
  for (;; std::this_thread::sleep_for(std::chrono::milliseconds{200})) {
    const Json status = send_request(arguments.control(), {{"command", "status"}}).json;
    if (!status.contains("incidents"))
      throw Failure(
          ExitStatus::failed,
          fmt::format("{}: incidents are off since the service was reloaded; this one may still be completed", folder));
    const Json& incidents = status["incidents"];
    if (incidents.value("last", "") == folder)
      return fmt::print("{}\n", folder);
    if (incidents.value("writing", "") != folder)
      throw Failure(ExitStatus::failed, incidents.value("refusal", "the incident was not stored"));
  }
}

void find_sensors(const DdsOptions& dds) {
  SensorSearch search(dds);
  search.listen(std::chrono::seconds{2});
  fmt::print("{}", search.proposal());
}

/// Parses the arguments to an action; nothing if help or version were requested.
std::function<void()> parse(int argc, char** argv, CtlArguments& arguments) {
  std::function<void()> action;
  CLI::App app{"Controls a running locusd.", "locusctl"};
  app.require_subcommand(1);
  app.fallthrough();
  app.add_option("--instance", arguments.instance, "Instance of the service, as in locusd@NAME")->type_name("NAME");
  app.add_option("--socket", arguments.socket, "Control socket of the service, if it is not in /run")
      ->type_name("PATH");
  app.set_version_flag("--version", "locusctl " LOCUS_VERSION);
  app.footer("All commands except status, calibration, sensors and fetch require root or group locusd.\n"
             "Examples:\n"
             "  locusctl status --watch\n"
             "  locusctl view\n"
             "  locusctl reset --pose 1,2,0,0,0,90\n"
             "  locusctl save-map map.pcd\n"
             "  locusctl record --keep 60s\n"
             "  locusctl calibration --yaml");
  CLI::App* const show = app.add_subcommand("status", "Shows the state and the counters of the service");
  show->add_flag("--json", arguments.json, "Prints JSON, for programs");
  show->add_flag("--watch", arguments.watch, "Refreshes until q or Ctrl-C");
  show->callback([&] { action = [&] { status(arguments); }; });
  CLI::App* const live = app.add_subcommand("view", "Shows the live robot in a browser: map, sweep, path, sources");
  live->add_option("--port", arguments.port, "Port of 127.0.0.1 to serve the page at")
      ->type_name("N")
      ->capture_default_str()
      ->check(CLI::Range(1, 65535));
  live->callback([&] { action = [&] { view(arguments.control(), arguments.port); }; });
  CLI::App* const flat = app.add_subcommand("flat-ground", "Sets whether the ground is assumed level");
  const auto modes = names_of(FlatGround{});
  flat->add_option("MODE", arguments.mode, "on, off or auto")
      ->required()
      ->check(CLI::IsMember(std::vector<std::string>(modes.begin(), modes.end())));
  flat->callback([&] {
    action = [&] { send_request(arguments.control(), {{"command", "flat-ground"}, {"mode", arguments.mode}}); };
  });
  CLI::App* const learned =
      app.add_subcommand("calibration", "Shows the learned delays, mountings and scales of motion sources");
  learned->add_flag("--yaml", arguments.yaml,
                    "Prints values better known than the configured ones, to paste into the configuration");
  learned->callback([&] { action = [&] { calibration(arguments); }; });
  CLI::App* const save = app.add_subcommand("save-map", "Writes the map as PCD");
  save->add_option("FILE", arguments.file)->required();
  save->callback([&] { action = [&] { save_map(arguments); }; });
  CLI::App* const again = app.add_subcommand("reset", "Resets the odometry, with an empty map");
  again
      ->add_option("--pose", arguments.pose,
                   "Initial pose: x,y,z in metres, roll,pitch,yaw in degrees; default: the origin")
      ->type_name("X,Y,Z,R,P,Y")
      ->delimiter(',')
      ->expected(6);
  again->callback([&] { action = [&] { reset(arguments); }; });
  app.add_subcommand("reload", "Reads the configuration again")->callback([&] {
    action = [&] { send_request(arguments.control(), {{"command", "reload"}}); };
  });
  CLI::App* const keep = app.add_subcommand("record", "Stores the latest input as an incident, for locus-replay");
  keep->add_option("--keep", arguments.keep, "Length of the input, e.g. 60s")->required()->type_name("SECONDS");
  keep->callback([&] { action = [&] { record(arguments); }; });
  CLI::App* const sensors = app.add_subcommand(
      "sensors", "Finds the lidars, IMUs and odometries on the network, and prints a configuration; needs no service");
  sensors->add_option("--interface", arguments.dds.interface, "Network interface of the ROS 2 nodes; default: lo")
      ->type_name("NAME");
  sensors->add_option("--domain", arguments.dds.domain, "Their ROS_DOMAIN_ID; default: 0")
      ->type_name("N")
      ->check(CLI::Range(0, 232));
  sensors->callback([&] { action = [&] { find_sensors(arguments.dds); }; });
  CLI::App* const from_lidar =
      app.add_subcommand("fetch", "Fetches an Ouster's metadata or a Hesai's angles from the lidar; needs no service");
  from_lidar->add_option("ADDRESS", arguments.address, "Address of the lidar, e.g. 192.168.1.201")->required();
  from_lidar->add_option("-o,--output", arguments.file, "Default: ADDRESS.json or ADDRESS.csv")->type_name("FILE");
  from_lidar->callback([&] { action = [&] { fmt::print("{}", fetch(arguments.address, arguments.file)); }; });
  if (!parse_command_line(app, argc, argv))
    return {};
  return action;
}

} // namespace
} // namespace locus::tools

int main(int argc, char** argv) {
  using namespace locus::tools;
  return exit_status_of("locusctl", [&] {
    CtlArguments arguments;
    if (const std::function<void()> action = parse(argc, argv, arguments))
      action();
  });
}
