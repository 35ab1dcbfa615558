// SPDX-License-Identifier: Apache-2.0
// locus-play: a capture folder to the wire, as a robot would send it.
#include <algorithm>
#include <ctime>
#include <exception>
#include <optional>
#include <thread>
#include <utility>
#include <variant>

#include <fmt/format.h>

#include "config/config_yaml.hpp"
#include "daemon/machine_time.hpp"
#include "daemon/paced_input.hpp"
#include "locus_play/arguments.hpp"
#include "locus_play/motion_publisher.hpp"
#include "locus_play/packet_sender.hpp"
#include "locus_replay/failure.hpp"
#include "locus_replay/motion_recordings.hpp"
#include "locus_replay/progress_bar.hpp"
#include "locus_replay/recording.hpp"
#include "locus_replay/say.hpp"

namespace locus::tools {
namespace {

void warn(const std::string& line) { say("locus-play", "warning: " + line); }

Config configuration(const PlayArguments& arguments, const CaptureFolder& folder) {
  Config config;
  if (!folder.config.empty()) {
    const auto loaded = load_config(folder.config);
    if (!loaded)
      throw Failure(ExitStatus::wrong_usage, fmt::format("{}", fmt::join(loaded.error(), "\n")));
    config = *loaded;
  }
  config.dds.interface = arguments.interface.value_or(config.dds.interface);
  config.dds.domain = arguments.domain.value_or(config.dds.domain);
  return config;
}

Recording open_recording(const PlayArguments& arguments, const CaptureFolder& folder, const Config& config) {
  check_faults(arguments.faults, config);
  std::vector<std::string> warnings;
  std::vector<MotionRecording> motion = read_motion({}, folder, config, !folder.config.empty(), warnings);
  for (const std::string& warning : warnings)
    warn(warning);
  return {value_or_fail(Capture::open(folder.lidar), ExitStatus::failed),
          std::move(motion),
          config,
          value_or_fail(LidarRouter::open(config.lidars), ExitStatus::wrong_usage),
          {.duration = {}, .faults = arguments.faults, .seed = config.sweep.seed}};
}

/// Those who run already are to hear the first sample; who does not run is not waited for.
void wait_for_listeners(const MotionPublisher& motion, const DdsOptions& dds) {
  constexpr Duration kPatience = std::chrono::seconds{3}, kLook = std::chrono::milliseconds{20};
  for (Duration waited{}; waited < kPatience && !motion.unheard().empty(); waited += kLook)
    std::this_thread::sleep_for(kLook);
  for (const std::string& topic : motion.unheard())
    warn(fmt::format("nobody listens to {} in DDS domain {} on interface {}; it is sent all the same", topic,
                     dds.domain, dds.interface));
}

/// Sends all there is, each at its time. The first input is sent now: what separates its arrival from that is what all
/// stamps are shifted by, in whole microseconds as the lidars count.
void play(const PlayArguments& arguments, Recording& recording, PacketSender& packets, MotionPublisher& motion) {
  daemon::PacedInput paced(recording, arguments.speed);
  ProgressBar bar(!arguments.quiet);
  std::optional<Duration> shift;
  const auto shift_from = [&](Stamp arrival) {
    if (!shift) {
      const Duration now = daemon::read_clock(CLOCK_REALTIME) - arrival.time_since_epoch();
      shift = arguments.keep_stamps ? Duration::zero() : std::chrono::floor<std::chrono::microseconds>(now);
    }
    return *shift;
  };
  for (bool more = true; more;) {
    const daemon::Input input = paced.next(std::chrono::milliseconds{100});
    if (const auto* datagram = std::get_if<Datagram>(&input))
      packets.send(*datagram, shift_from(datagram->receive_stamp));
    else if (const auto* imu = std::get_if<daemon::ImuInput>(&input))
      motion.publish(*imu, shift_from(imu->sample.arrival));
    else if (const auto* odometry = std::get_if<daemon::OdometryInput>(&input))
      motion.publish(*odometry, shift_from(odometry->sample.arrival));
    more = !std::holds_alternative<daemon::EndOfInput>(input);
    bar.show(recording.progress());
  }
  bar.wipe();
  if (!arguments.quiet)
    fmt::print("{} packets sent, stamps shifted by {} ns\n", packets.sent(), shift.value_or(Duration::zero()).count());
}

void run(const PlayArguments& arguments) {
  const CaptureFolder folder = value_or_fail(CaptureFolder::find(arguments.capture), ExitStatus::failed);
  const Config config = configuration(arguments, folder);
  Recording recording = open_recording(arguments, folder, config);
  PacketSender packets(arguments.to, arguments.interface.value_or(""));
  MotionPublisher motion(config);
  wait_for_listeners(motion, config.dds);
  play(arguments, recording, packets, motion);
  for (const std::string& warning : recording.capture().warnings())
    warn(warning);
  if (motion.refused() > 0)
    warn(fmt::format("{} motion samples were not sent: DDS did not take them", motion.refused()));
  if (packets.sent() == 0)
    throw Failure(ExitStatus::failed,
                  fmt::format("{}: holds no UDP datagram; nothing was sent", folder.lidar.string()));
  const bool asked_for_sender =
      std::ranges::any_of(config.lidars, [](const auto& l) { return l.source_ip.has_value(); });
  if (packets.changed_sender() && asked_for_sender)
    warn(
        "this host has not the addresses of the lidars: a receiver whose configuration names source_ip has refused the "
        "packets");
}

} // namespace
} // namespace locus::tools

int main(int argc, char** argv) {
  using namespace locus::tools;
  try {
    if (const std::optional<PlayArguments> arguments = parse_play_arguments(argc, argv))
      run(*arguments);
    return static_cast<int>(ExitStatus::done);
  } catch (const Failure& failure) {
    say("locus-play", failure.what());
    return static_cast<int>(failure.status());
  } catch (const std::exception& error) { // out of memory or threads
    say("locus-play", error.what());
    return static_cast<int>(ExitStatus::failed);
  }
}
