// SPDX-License-Identifier: Apache-2.0
// locus-play: sends a capture folder, or a stream, as a robot would.
#include <algorithm>
#include <ctime>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <thread>
#include <utility>
#include <variant>

#include <fmt/format.h>
#include <unistd.h>

#include "command_line.hpp"
#include "config/config_yaml.hpp"
#include "config/lidar_metadata.hpp"
#include "daemon/input.hpp"
#include "daemon/machine_time.hpp"
#include "drivers/files/capture_sequence.hpp"
#include "locus_play/arguments.hpp"
#include "locus_play/lockstep.hpp"
#include "locus_play/motion_publisher.hpp"
#include "locus_play/packet_sender.hpp"
#include "locus_play/stream_recording.hpp"
#include "locus_replay/failure.hpp"
#include "locus_replay/motion_recordings.hpp"
#include "locus_replay/ouster_metadata.hpp"
#include "locus_replay/print_message.hpp"
#include "locus_replay/progress_bar.hpp"
#include "locus_replay/recording.hpp"
#include "unpacking/unpacking_stream.hpp"

namespace locus::tools {
namespace {

void warn(const std::string& line) { print_message("locus-play", "warning: " + line); }

Config config_or_fail(Expected<Config, ConfigErrors> config) {
  if (!config)
    throw Failure(ExitStatus::wrong_usage, fmt::format("{}", fmt::join(config.error(), "\n")));
  return *std::move(config);
}

Config with_options(Config config, const PlayArguments& arguments) {
  config.dds.interface = arguments.interface.value_or(config.dds.interface);
  config.dds.domain = arguments.domain.value_or(config.dds.domain);
  check_faults(arguments.faults, config);
  return config;
}

Recording open_recording(const PlayArguments& arguments, const CaptureFolder& folder, const Config& config) {
  std::vector<std::string> warnings;
  std::vector<MotionRecording> motion = read_motion({}, folder, config, !folder.config.empty(), warnings);
  for (const std::string& warning : warnings)
    warn(warning);
  return {std::make_unique<CaptureSequence>(
              value_or_fail(CaptureSequence::open(folder.lidar, open_capture), ExitStatus::failed)),
          std::move(motion),
          config,
          value_or_fail(LidarRouter::open(config.lidars), ExitStatus::wrong_usage),
          {.duration = {}, .faults = arguments.faults, .seed = config.sweep.seed}};
}

/// Waits for subscribers that already run, so that they receive the first sample; gives up after kPatience.
void wait_for_subscribers(const MotionPublisher& motion, const DdsOptions& dds) {
  constexpr Duration kPatience = std::chrono::seconds{3}, kPollPeriod = std::chrono::milliseconds{20};
  for (Duration waited{}; waited < kPatience && !motion.topics_without_subscribers().empty(); waited += kPollPeriod)
    std::this_thread::sleep_for(kPollPeriod);
  for (const std::string& topic : motion.topics_without_subscribers())
    warn(fmt::format("{} has no subscriber in DDS domain {} on interface {}; it is sent nevertheless", topic,
                     dds.domain, dds.interface));
}

/// Wall clock: the pace follows steps of the host's clock, and a test may control it.
const daemon::PacedInput::Clock kWallClock{[] { return daemon::read_clock(CLOCK_REALTIME); },
                                           [](Duration time) { std::this_thread::sleep_for(time); }};

std::vector<std::string> names_on_topics(const Config& config) {
  std::vector<std::string> names;
  for (const MotionSource& source : config.motion_sources)
    if (!source.topic.empty())
      names.push_back(source.name);
  return names;
}

/// Sends all inputs, each at its time. The first is sent now: the difference to its arrival shifts all stamps, in whole
/// microseconds, the lidars' resolution. The clock shows the arrival of the next input, so no sensor's stamp is ahead
/// of it by more than its period.
void send_all(const PlayArguments& arguments, daemon::InputSource& recording, PacketSender& packets,
              MotionPublisher& motion, Lockstep* lockstep, const std::function<double()>& progress) {
  daemon::PacedInput paced(recording, arguments.speed,
                           lockstep != nullptr ? kWallClock : daemon::PacedInput::kHostClock);
  ProgressBar bar(!arguments.quiet);
  std::optional<Duration> shift;
  const auto shift_at = [&](Stamp arrival) {
    if (!shift) {
      const Duration now = daemon::read_clock(CLOCK_REALTIME) - arrival.time_since_epoch();
      shift = arguments.keep_stamps ? Duration::zero() : std::chrono::floor<std::chrono::microseconds>(now);
    }
    motion.publish_clock(arrival + *shift);
    if (lockstep != nullptr)
      lockstep->wait_until_processed(arrival);
    return *shift;
  };
  for (bool more = true; more;) {
    const daemon::Input input = paced.next(MotionPublisher::kClockPeriod);
    if (const auto* datagram = std::get_if<Datagram>(&input))
      packets.send(*datagram, shift_at(datagram->receive_stamp));
    else if (const auto* imu = std::get_if<daemon::ImuInput>(&input))
      motion.publish(*imu, shift_at(imu->sample.arrival));
    else if (const auto* odometry = std::get_if<daemon::OdometryInput>(&input))
      motion.publish(*odometry, shift_at(odometry->sample.arrival));
    else if (const auto* silence = std::get_if<daemon::Silence>(&input); silence != nullptr && shift)
      motion.publish_clock(silence->now + *shift);
    more = !std::holds_alternative<daemon::EndOfInput>(input);
    bar.show(progress());
  }
  bar.wipe();
  if (!arguments.quiet)
    fmt::print("{} packets sent, stamps shifted by {} ns\n", packets.sent(), shift.value_or(Duration::zero()).count());
}

void play(const PlayArguments& arguments, const Config& config, daemon::InputSource& recording,
          const DatagramSource& source, const std::function<double()>& progress) {
  PacketSender packets(arguments.to, arguments.interface.value_or(config.dds.interface),
                       value_or_fail(LidarRouter::open(config.lidars), ExitStatus::wrong_usage));
  MotionPublisher motion(config, arguments.clock);
  std::optional<Lockstep> lockstep;
  if (arguments.lockstep.empty())
    wait_for_subscribers(motion, config.dds);
  else
    lockstep.emplace(arguments.lockstep).wait_for_writers(names_on_topics(config));
  send_all(arguments, recording, packets, motion, lockstep ? &*lockstep : nullptr, progress);
  for (const std::string& warning : source.warnings())
    warn(warning);
  if (motion.refused() > 0)
    warn(fmt::format("{} motion samples were not sent: DDS did not accept them", motion.refused()));
  if (packets.sent() == 0)
    throw Failure(ExitStatus::failed,
                  fmt::format("{}: contains no UDP datagram; nothing was sent", arguments.capture.string()));
  const bool expects_source_ip =
      std::ranges::any_of(config.lidars, [](const auto& l) { return l.source_ip.has_value(); });
  if (packets.changed_sender() && expects_source_ip)
    warn("this host does not have the addresses of the lidars: a receiver with source_ip in its configuration has "
         "rejected the packets");
}

void play_folder(const PlayArguments& arguments) {
  const CaptureFolder folder = value_or_fail(CaptureFolder::find(arguments.capture), ExitStatus::failed);
  Config config;
  if (!folder.config.empty())
    config = config_or_fail(load_config(folder.first_config()));
  use_recorded_metadata(folder, config);
  config = config_or_fail(with_lidar_metadata(std::move(config)));
  if (const auto changed = folder.changed_config())
    warn(*changed);
  config = with_options(std::move(config), arguments);
  Recording recording = open_recording(arguments, folder, config);
  play(arguments, config, recording, recording.source(), [&] { return recording.progress(); });
}

/// Plays a file, or standard input, of unknown length.
void play_stream(const PlayArguments& arguments) {
  if (arguments.capture == "-" && isatty(STDIN_FILENO) == 1)
    throw Failure(ExitStatus::wrong_usage, "-: standard input is a terminal; try: locus-sim ... -o - | locus-play -");
  CaptureStream stream(value_or_fail(open_capture(arguments.capture), ExitStatus::failed));
  const Config config = with_options(
      config_or_fail(parse_config(stream.config(), arguments.capture.string() + ": config.yaml")), arguments);
  StreamRecording recording(stream, config, value_or_fail(LidarRouter::open(config.lidars), ExitStatus::wrong_usage),
                            arguments.faults);
  play(arguments, config, recording, stream.capture(), [&] { return stream.capture().progress(); });
  for (const std::string& file : recording.unknown_files())
    warn(fmt::format("{}: no motion source is configured for it; not sent", file));
  if (recording.problem())
    throw Failure(ExitStatus::failed, *recording.problem());
}

void run(const PlayArguments& arguments) {
  if (std::filesystem::is_directory(arguments.capture))
    play_folder(arguments);
  else
    play_stream(arguments);
}

} // namespace
} // namespace locus::tools

int main(int argc, char** argv) {
  using namespace locus::tools;
  return exit_status_of("locus-play", [&] {
    if (const std::optional<PlayArguments> arguments = parse_play_arguments(argc, argv))
      run(*arguments);
  });
}
