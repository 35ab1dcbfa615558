// SPDX-License-Identifier: Apache-2.0
#include "locus_play/arguments.hpp"

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "command_line.hpp"
#include "locus_replay/failure.hpp"
#include "locus_replay/number_between.hpp"

namespace locus::tools {

std::optional<PlayArguments> parse_play_arguments(int argc, char** argv) {
  PlayArguments arguments;
  std::vector<std::string> faults;
  CLI::App app{"Sends a recorded capture as the robot would: lidar packets by UDP, IMU and odometry by DDS.",
               "locus-play"};
  app.add_option("CAPTURE_FOLDER", arguments.capture,
                 "Folder with lidar.pcap and any of imu.csv, NAME.tum and config.yaml, which names the topics; or a "
                 "capture file; -: the stream of locus-sim on standard input")
      ->required();
  app.add_option("--to", arguments.to, "Destination of packets: a host, a broadcast or a multicast address")
      ->type_name("ADDRESS")
      ->check(CLI::ValidIPV4)
      ->capture_default_str();
  app.add_option("--speed", arguments.speed,
                 "Playback speed relative to the recording; other than 1 requires time: sensor at the receiver")
      ->type_name("X")
      ->check(number_between(0.01, 1000))
      ->capture_default_str();
  app.add_option("--interface", arguments.interface,
                 "Network interface of DDS and of multicast; default: dds.interface")
      ->type_name("NAME");
  app.add_option("--domain", arguments.domain, "DDS domain; default: dds.domain")
      ->type_name("N")
      ->check(CLI::Range(0, 232));
  app.add_flag("--keep-stamps", arguments.keep_stamps,
               "Leaves all stamps as recorded, instead of making the first now");
  app.add_flag("--clock", arguments.clock,
               "Publishes the time of the recording on /clock, for nodes with use_sim_time");
  app.add_option("--fail", faults, "Injects a fault, as locus-replay does, e.g. front:lost@10-20; may be repeated")
      ->type_name("SPEC")
      ->allow_extra_args(false);
  app.add_option(
         "--lockstep", arguments.lockstep,
         "Waits until the service of this control socket has processed each sweep before it sends more, so that "
         "a computer that is too slow or busy loses none")
      ->type_name("SOCKET");
  app.add_flag("--quiet", arguments.quiet, "Prints only warnings and errors");
  app.set_version_flag("--version", "locus-play " LOCUS_VERSION);
  app.footer("Examples:\n"
             "  locus-play robot_folder/\n"
             "  locus-play --to 192.168.1.255 --interface eth0 --domain 7 robot_folder/\n"
             "  locus-play --fail wio:jump=5@30 robot_folder/\n"
             "  locus-sim --world urban --robot husky --duration 600 -o - | locus-play -");
  if (!parse_command_line(app, argc, argv))
    return std::nullopt;
  for (const std::string& text : faults)
    arguments.faults.push_back(value_or_fail(Fault::parse(text), ExitStatus::wrong_usage));
  return arguments;
}

} // namespace locus::tools
