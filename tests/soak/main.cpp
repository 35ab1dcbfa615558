// SPDX-License-Identifier: Apache-2.0
// soak: a day of driving through the live threads of the daemon, as fast as possible.
#include <cmath>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "closed_course.hpp"
#include "command_line.hpp"
#include "locus_replay/failure.hpp"
#include "locus_replay/number_between.hpp"
#include "locus_replay/print_message.hpp"
#include "piece.hpp"
#include "soak.hpp"
#include "verdict.hpp"

namespace locus::soak {

namespace {

using tools::ExitStatus;
using tools::Failure;

volatile std::sig_atomic_t interrupted = 0;

struct Arguments {
  double hours = 24.0, piece_minutes = 10.0;
  std::filesystem::path folder;
};

/// Nothing if --help was requested and printed.
std::optional<Arguments> parse_arguments(int argc, char** argv) {
  Arguments arguments;
  CLI::App app{"Drives a robot around a closed course for a day, as fast as the machine can compute.", "soak"};
  app.add_option("--hours", arguments.hours, "Duration by the stamps; default 24")
      ->type_name("H")
      ->check(tools::number_between(0.001, 1000));
  app.add_option("--piece-minutes", arguments.piece_minutes, "Duration of a lap; default 10")
      ->type_name("M")
      ->check(tools::number_between(0.5, 50));
  app.add_option("STATE_FOLDER", arguments.folder, "Course, saved state and pieces.jsonl; created if missing")
      ->required();
  app.footer("Interrupted, it ends after the lap; called again, it resumes after the last complete one.\n"
             "Ends with status 1 when a bound is broken.");
  return tools::parse_command_line(app, argc, argv) ? std::optional(arguments) : std::nullopt;
}

void print(const Piece& piece) {
  fmt::print("hour {:6.2f}: {:.3f} ms of CPU per sweep (99 % within {:.2f}), {:.2f} MB, {} descriptors, "
             "error {:.1f} mm, {:.0f} mm astray; {}{}\n",
             piece.hour, piece.cpu_p50_ms, piece.cpu_p99_ms, piece.rss_anon_mb, piece.descriptors, piece.ape_mean_mm,
             piece.astray_mm, piece.faults, piece.restarts > 0 ? "; restarted" : "");
  std::fflush(stdout);
}

std::string text_of(const std::optional<double>& figure) {
  return figure ? fmt::format("{:.3f}", *figure) : "not judged, too short";
}

void check_lap(const std::vector<Piece>& pieces, const ClosedCourse& course, const std::filesystem::path& folder) {
  if (!pieces.empty() && std::abs(pieces.back().lap_s - to_seconds(course.lap)) > 1e-3)
    throw Failure(ExitStatus::wrong_usage,
                  fmt::format("{}: was started with laps of {:.1f} min; use --piece-minutes {:.1f} or another folder",
                              folder.string(), pieces.back().lap_s / 60.0, pieces.back().lap_s / 60.0));
}

int run(const Arguments& arguments) {
  std::filesystem::create_directories(arguments.folder);
  const std::filesystem::path file = arguments.folder / "pieces.jsonl";
  std::vector<Piece> pieces = read_pieces(file);
  const Duration about = from_seconds(60.0 * arguments.piece_minutes);
  const ClosedCourse course =
      closed_course(arguments.folder / fmt::format("lap_{}s", about / Duration{1'000'000'000}), about);
  check_lap(pieces, course, arguments.folder);
  const auto laps = static_cast<std::uint64_t>(std::ceil(3600.0 * arguments.hours / to_seconds(course.lap)));
  if (pieces.size() < laps) {
    Soak soak(course, arguments.folder, pieces.size(), laps);
    while (pieces.size() < laps && interrupted == 0) {
      pieces.push_back(soak.drive_lap());
      append(file, pieces.back());
      print(pieces.back());
    }
  }
  const Verdict verdict = judge(pieces);
  fmt::print("{} of {} laps. Memory grows by {} MB an hour; the last hour relative to the first: CPU {}, latency {}.\n",
             pieces.size(), laps, text_of(verdict.growth_mb_per_hour), text_of(verdict.cpu_drift),
             text_of(verdict.latency_drift));
  for (const std::string& broken : verdict.broken)
    fmt::print("broken: {}\n", broken);
  fmt::print("{}\n", verdict.broken.empty() ? "All bounds hold." : "Bounds are broken.");
  return static_cast<int>(verdict.broken.empty() ? ExitStatus::done : ExitStatus::failed);
}

} // namespace

} // namespace locus::soak

int main(int argc, char** argv) {
  using namespace locus;
  for (const int number : {SIGINT, SIGTERM})
    std::signal(number, [](int) { soak::interrupted = 1; });
  try {
    const std::optional<soak::Arguments> arguments = soak::parse_arguments(argc, argv);
    return arguments ? soak::run(*arguments) : 0;
  } catch (const tools::Failure& failure) {
    tools::print_message("soak", failure.what());
    return static_cast<int>(failure.status());
  } catch (const std::exception& error) { // out of memory, threads or disk
    tools::print_message("soak", error.what());
    return static_cast<int>(tools::ExitStatus::failed);
  }
}
