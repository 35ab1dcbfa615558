// SPDX-License-Identifier: Apache-2.0
// locus-sim: writes the capture folder of a synthetic robot with exact truth.
#include <optional>

#include <fmt/format.h>

#include "command_line.hpp"
#include "daemon/machine_time.hpp"
#include "locus_replay/output_file.hpp"
#include "locus_replay/print_message.hpp"
#include "locus_replay/progress_bar.hpp"
#include "locus_sim/arguments.hpp"
#include "locus_sim/capture_writer.hpp"
#include "locus_sim/folder_sink.hpp"
#include "locus_sim/observed_space.hpp"
#include "locus_sim/stream_sink.hpp"
#include "locus_sim/surroundings.hpp"
#include "locus_sim/truth_map.hpp"

namespace locus::tools {
namespace {

void run(const SimArguments& arguments) {
  const daemon::MachineTime begin = daemon::MachineTime::now();
  std::optional<sim::FolderSink> folder; // checked before the drive, which may take an hour
  std::optional<OutputFile> map;
  if (arguments.output != "-") {
    folder.emplace(arguments.output);
    map.emplace(arguments.output / "gt_map.ply");
  }
  sim::World world = arguments.world.make(arguments.seed);
  sim::Robot robot = arguments.robot.make(arguments.sensors, arguments.seed);
  if (arguments.halts_s)
    robot.agility.halts = {.share = 0.5, .longest_s = *arguments.halts_s};
  const sim::Trajectory trajectory =
      sim::drive_about(world, robot, arguments.duration, arguments.slips, arguments.seed);
  const bool has_room = surround(world, robot, trajectory, arguments.sensors.imperfections, arguments.seed);
  if (!has_room && arguments.names_vehicle)
    print_message("locus-sim",
                  fmt::format("warning: --vehicle-s-per-min: there is no room on this drive for a vehicle beside a "
                              "{} in --world {}, so there is none; try a wider world, another seed or a longer drive",
                              arguments.robot.name, arguments.world.name));
  if (!folder) {
    sim::StreamSink sink;
    write_capture(sink, world.scene, trajectory, arguments.duration, robot.sensors);
    return;
  }
  sim::ObservedSpace observed(world.scene.bounds());
  ProgressBar bar(true);
  write_capture(*folder, world.scene, trajectory, arguments.duration, robot.sensors, &observed,
                [&](double done) { bar.show(done); });
  write_truth_map(*map, world.scene, observed);
  bar.wipe();
  const daemon::MachineTime spent = daemon::MachineTime::now() - begin;
  fmt::print("{}: {:.0f} m in {:.0f} s, {:.1f} times faster than that on one core ({:.1f} s)\n",
             arguments.output.string(), trajectory.length_m(), to_seconds(arguments.duration),
             to_seconds(arguments.duration) / to_seconds(spent.cpu), to_seconds(spent.cpu));
}

} // namespace
} // namespace locus::tools

int main(int argc, char** argv) {
  using namespace locus::tools;
  return exit_status_of("locus-sim", [&] {
    if (const std::optional<SimArguments> arguments = parse_sim_arguments(argc, argv))
      run(*arguments);
  });
}
