// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/arguments.hpp"

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <optional>
#include <string>

#include "command_line.hpp"
#include "locus_replay/failure.hpp"
#include "locus_replay/number_between.hpp"

namespace locus::tools {
namespace {

constexpr double kShortest_s = 1, kLongest_s = 24 * 3600;

template <class Named> std::vector<std::string> names_of(const Named& all) {
  std::vector<std::string> names;
  names.reserve(all.size());
  for (const auto& each : all)
    names.emplace_back(each.name);
  return names;
}

template <class Named> auto by_name(const Named& all, const std::string& name) {
  return *std::find_if(all.begin(), all.end(), [&](const auto& each) { return each.name == name; });
}

/// Parses FROM-TO in seconds.
sim::Slip parse_slip(const std::string& text, double duration_s) {
  const std::size_t dash = text.find('-');
  double from_s = 0, to_s = 0;
  const bool numbers = dash != std::string::npos && CLI::detail::lexical_cast(text.substr(0, dash), from_s) &&
                       CLI::detail::lexical_cast(text.substr(dash + 1), to_s);
  if (!numbers || !(from_s >= 0 && from_s < to_s && to_s <= duration_s))
    throw Failure(ExitStatus::wrong_usage,
                  fmt::format("--slip {}: must be FROM-TO in seconds within the duration, for example 20-25", text));
  return {from_seconds(from_s), from_seconds(to_s)};
}

std::vector<sim::Slip> parse_slips(const std::vector<std::string>& texts, double duration_s) {
  std::vector<sim::Slip> slips;
  slips.reserve(texts.size());
  for (const std::string& text : texts)
    slips.push_back(parse_slip(text, duration_s));
  std::sort(slips.begin(), slips.end(), [](const sim::Slip& a, const sim::Slip& b) { return a.from < b.from; });
  for (std::size_t i = 1; i < slips.size(); ++i) {
    if (slips[i].from < slips[i - 1].to)
      throw Failure(ExitStatus::wrong_usage,
                    fmt::format("--slip: the slip at {} s begins before the one at {} s ends; use separate times",
                                to_seconds(slips[i].from), to_seconds(slips[i - 1].from)));
  }
  return slips;
}

sim::Realism realism_from(const std::string& name) {
  return static_cast<sim::Realism>(std::ranges::find(sim::kRealismNames, name) - sim::kRealismNames.begin());
}

/// Adds an imperfection's option; without it, the size of --realism applies.
void add_imperfection(CLI::App& app, const sim::NamedImperfection& one, std::optional<double>& size) {
  const std::string text = fmt::format("{}; real {:g}, harsh {:g}", one.what, one.real, one.harsh);
  auto* option = app.add_option(fmt::format("--{}", one.name), size, text)
                     ->type_name(std::string(one.unit))
                     ->group("Imperfections")
                     ->check(number_between(0, one.most));
  if (one.whole)
    option->check(CLI::Validator(
        [](const std::string& number) {
          return number.find_first_not_of("0123456789") == std::string::npos ? "" : number + " is not a whole number";
        },
        ""));
}

void check_model(const SimArguments& arguments, const sim::NamedLidarModel& lidar) {
  if (arguments.sensors.return_mode == velodyne::ReturnMode::dual &&
      !std::holds_alternative<velodyne::Model>(lidar.model))
    throw Failure(ExitStatus::wrong_usage,
                  fmt::format("--return dual: a simulated {} reports one echo; leave it out, or choose a Velodyne with "
                              "--model",
                              lidar.name));
  if (arguments.output == "-" && is_ouster(lidar.model))
    throw Failure(ExitStatus::wrong_usage,
                  fmt::format("-o -: a stream cannot contain the metadata of an {}; write a folder with -o DIR and "
                              "play that",
                              lidar.name));
}

} // namespace

std::optional<SimArguments> parse_sim_arguments(int argc, char** argv) {
  SimArguments arguments;
  std::string world, robot, model = "VLP-16", return_mode = "strongest";
  double duration_s = 0;
  std::string realism{sim::kRealismNames[static_cast<std::size_t>(sim::Realism::real)]};
  bool no_noise = false;
  std::vector<std::string> slips;

  CLI::App app{"Simulates the drive of a robot and writes a capture folder with exact truth.", "locus-sim"};
  app.add_option("--world", world, "World to drive in")->required()->check(CLI::IsMember(names_of(sim::kWorlds)));
  app.add_option("--robot", robot, "Robot that drives")->required()->check(CLI::IsMember(names_of(sim::kRobots)));
  app.add_option("--duration", duration_s, "Duration, seconds")
      ->required()
      ->type_name("S")
      ->check(number_between(kShortest_s, kLongest_s));
  app.add_option("--seed", arguments.seed, "Seed of course, clutter, moving objects and noise; default 1")
      ->type_name("N")
      ->check(CLI::Range(0.0, 1e15));
  app.add_option("--lidars", arguments.sensors.lidars,
                 "Number of lidars: 1: level, 2: and one pitched forward, 3: and one backward")
      ->type_name("N")
      ->check(CLI::Range(1, 3));
  app.add_option("--model", model, "Model of all lidars; default VLP-16")
      ->check(CLI::IsMember(names_of(sim::kLidarModels)));
  app.add_option("--return", return_mode, "Return mode of all lidars; default strongest")
      ->check(CLI::IsMember({"strongest", "dual"}));
  auto* realism_option =
      app.add_option("--realism", realism, "Sets all imperfections below: none, as on real robots, or harsh")
          ->capture_default_str()
          ->check(CLI::IsMember(std::vector<std::string>(sim::kRealismNames.begin(), sim::kRealismNames.end())));
  app.add_flag("--no-noise", no_noise, "Perfect sensors in a clean world, except for the imperfections given below")
      ->excludes(realism_option);
  app.add_option("--slip", slips, "Wheels or feet slip while the robot stands, seconds from the start; may be repeated")
      ->type_name("T-T1")
      ->allow_extra_args(false);
  app.add_option("--halts", arguments.halts_s, "Stops at every other corner, for up to S seconds")
      ->type_name("S")
      ->check(number_between(0.5, 3600));
  app.add_option("--dust", arguments.sensors.dust, "Share of the laser pulses that hit dust, 0..1")
      ->type_name("P")
      ->check(number_between(0, 1));
  app.add_option("-o,--output", arguments.output,
                 "Capture folder; created if missing. -: a stream on standard output, for locus-play")
      ->required()
      ->type_name("DIR");
  std::array<std::optional<double>, sim::kImperfections.size()> sizes;
  for (std::size_t i = 0; i < sizes.size(); ++i)
    add_imperfection(app, sim::kImperfections[i], sizes[i]);
  app.set_version_flag("--version", "locus-sim " LOCUS_VERSION);
  app.footer(
      "Writes lidar.pcap, imu.csv, one NAME.tum per odometry source, gt.tum, gt_map.ply and config.yaml; for an OS1\n"
      "its metadata, NAME.json, and its inertial unit's packets in place of imu.csv. The same options give the same\n"
      "bytes.\n\n"
      "Examples:\n"
      "  locus-sim --world urban --robot husky --duration 60 --seed 1 -o plant\n"
      "  locus-sim --world tunnel --robot spot --duration 300 --seed 7 --slip 20-25 --dust 0.02 -o mine\n"
      "  locus-sim --world corridor --robot husky --duration 60 --realism clean --people 4 -o crowd\n"
      "  locus-sim --world stairs --robot handheld --duration 60 --model OS1-32 -o climb\n"
      "  locus-replay -o out plant\n"
      "  locus-sim --world urban --robot husky --duration 600 -o - | locus-play -");
  if (!parse_command_line(app, argc, argv))
    return std::nullopt;

  arguments.world = by_name(sim::kWorlds, world);
  arguments.robot = by_name(sim::kRobots, robot);
  arguments.duration = from_seconds(duration_s);
  arguments.names_vehicle = app.count("--vehicle-s-per-min") > 0;
  arguments.slips = parse_slips(slips, duration_s);
  const auto lidar = by_name(sim::kLidarModels, model);
  arguments.sensors.model = lidar.model;
  arguments.sensors.return_mode = return_mode == "dual" ? velodyne::ReturnMode::dual : velodyne::ReturnMode::strongest;
  check_model(arguments, lidar);
  arguments.sensors.noise = !no_noise;
  arguments.sensors.imperfections = sim::imperfections_of(no_noise ? sim::Realism::clean : realism_from(realism));
  for (std::size_t i = 0; i < sizes.size(); ++i)
    if (sizes[i])
      arguments.sensors.imperfections.*sim::kImperfections[i].size = *sizes[i];
  return arguments;
}

} // namespace locus::tools
