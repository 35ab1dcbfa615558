// SPDX-License-Identifier: Apache-2.0
#include "locus_experiments/accuracy_table.hpp"

#include <algorithm>
#include <functional>
#include <set>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace locus::experiments {
namespace {

constexpr double kAllowedShare = 0.01, kAllowed_m = 0.03, kAllowedSigma = 3;

/// Formats with decimals to suit the magnitude; empty for null.
std::string number(const Results& value) {
  if (!value.is_number())
    return "";
  const auto number = value.get<double>();
  const int decimals = number < 1 ? 3 : number < 10 ? 2 : number < 100 ? 1 : 0;
  return fmt::format("{:.{}f}", number, decimals);
}

/// Appends the models of the lidars, if the run determined them.
std::string name_of(const Results& row) {
  std::set<std::string> models;
  for (const Results& lidar : row.at("run").at("summary").value("lidars", Results::object())) {
    if (const Results& model = lidar.value("model", Results{}); model.is_string())
      models.insert(model);
  }
  return fmt::format("{}{}{}", row.at("recording").get<std::string>(), models.empty() ? "" : ", ",
                     fmt::join(models, ", "));
}

std::string sources_of(const Results& run) {
  const auto sources = run.at("sources").get<std::vector<std::string>>();
  return sources.empty() ? "lidar alone" : fmt::format("{}", fmt::join(sources, ", "));
}

std::string states_of(const Results& run) {
  std::vector<std::string> states;
  for (const auto& [state, count] : run.at("states").items())
    states.push_back(fmt::format("{} {}", state, count.get<int>()));
  return fmt::format("{}", fmt::join(states, ", "));
}

/// Formats sweeps received and failed, states and times, the common columns of both tables.
std::string course_of_run(const Results& run) {
  const Results &summary = run.at("summary"), &sweeps = summary.at("sweeps");
  const auto times = [](const Results& took) {
    return fmt::format("{:.1f}, {:.1f}", took.at("p50").get<double>(), took.at("p99").get<double>());
  };
  return fmt::format("{}, {} | {} | {} | {}", sweeps.at("seen").get<int>(), sweeps.at("failed").get<int>(),
                     states_of(run), times(summary.at("process_ms")), times(summary.at("process_cpu_ms")));
}

bool has_truth(const Results& run) { return run.contains("way") && run.at("summary").contains("ape_m"); }

std::string row_with_truth(const Results& row) {
  const Results& run = row.at("run");
  const Results &summary = run.at("summary"), &way = run.at("way"), &ape_m = summary.at("ape_m");
  const double way_m = way.at("way_m");
  const std::vector<std::string> broken = what_does_not_hold(run);
  return fmt::format("| {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} |\n", name_of(row), sources_of(run),
                     number(way_m), number(ape_m.at("mean")), number(ape_m.at("max")),
                     number(summary.at("rpe_10m_percent")), number(way.at("percent")),
                     number(summary.at("end_drift_m")),
                     way_m > 1 ? number(100 * summary.at("end_drift_m").get<double>() / way_m) : "",
                     number(summary.at("covariance").at("worst_sigma")), course_of_run(run),
                     broken.empty() ? "yes" : fmt::format("**no**: {}", fmt::join(broken, "; ")));
}

std::string table_with_truth(const Results& rows) {
  std::string text =
      "| recording | motion sources | distance, m | mean error, m | largest, m | over 10 m, % | over 100 to 800 m, % | "
      "end, m | end, % | worst sigma | sweeps, failed | states | ms per sweep, median, 99 % | CPU ms, median, 99 % | "
      "holds |\n"
      "|---|---|---:|---:|---:|---:|---:|---:|---:|---:|---|---|---|---|---|\n";
  for (const Results& row : rows)
    text += row_with_truth(row);
  return text + '\n';
}

std::string speed_by(const Results& receiver) {
  if (receiver.is_null())
    return "";
  const auto fixes = receiver.at("fixes").get<int>();
  return fmt::format("{:.1f} to {:.1f}, {} fix{}", receiver.at("min_mps").get<double>(),
                     receiver.at("max_mps").get<double>(), fixes, fixes == 1 ? "" : "es");
}

/// Formats the motion; a single pose has none.
std::string motion_of(const Results& claims) {
  if (claims.at("speed_mps").is_null())
    return " | | ";
  const Results& speed = claims.at("speed_mps");
  return fmt::format("{}, {} | {} | {}, {}", number(claims.at("farthest_at_first_m")), number(claims.at("farthest_m")),
                     number(claims.at("most_turned_deg")), number(speed.at("median")), number(speed.at("max")));
}

std::string table_of_claims(const Results& rows) {
  std::string text =
      "| recording | motion sources | s | farthest from the first pose, in half a second, in all, m | largest turn, "
      "deg | "
      "speed, median, largest, m/s | by GPS, m/s | sweeps, failed | states | ms per sweep, median, 99 % | "
      "CPU ms, median, 99 % |\n"
      "|---|---|---:|---|---:|---|---|---|---|---|---|\n";
  for (const Results& row : rows) {
    const Results& run = row.at("run");
    text += fmt::format("| {} | {} | {:.1f} | {} | {} | {} |\n", name_of(row), sources_of(run),
                        run.at("summary").at("duration_s").get<double>(), motion_of(run.at("claims")),
                        speed_by(row.at("receiver")), course_of_run(run));
  }
  return text + '\n';
}

/// Collects all runs that `wanted` selects, each with the data of its recording that its row needs.
Results rows_of(const Results& results, const std::function<bool(const Results&, const Results&)>& wanted) {
  Results rows = Results::array();
  for (const Results& recording : results.at("recordings")) {
    for (const Results& run : recording.at("runs")) {
      if (wanted(recording, run))
        rows.push_back({{"recording", recording.at("recording")},
                        {"receiver", recording.value("receiver", Results{})},
                        {"run", run}});
    }
  }
  return rows;
}

std::string part(const char* title, const Results& rows, const std::string& text) {
  return rows.empty() ? "" : fmt::format("## {}\n\n{}", title, text);
}

std::string failures(const Results& rows) {
  std::string text = "| recording | reason |\n|---|---|\n";
  for (const Results& row : rows)
    text += fmt::format("| {} | {} |\n", row.at("recording").get<std::string>(),
                        row.at("run").at("failed").get<std::string>());
  return text + '\n';
}

/// Lists each line once per recording.
std::string warnings(const Results& results) {
  std::string text;
  for (const Results& recording : results.at("recordings")) {
    std::set<std::string> seen_lines;
    for (const Results& run : recording.at("runs")) {
      for (const Results& line : run.value("warnings", Results::array())) {
        if (seen_lines.insert(line).second)
          text += fmt::format("- {}: {}\n", recording.at("recording").get<std::string>(), line.get<std::string>());
      }
    }
  }
  return text.empty() ? "" : "## Warnings of locus-replay\n\n" + text + '\n';
}

std::string kitti_note(const Results& results) {
  const Results drives = rows_of(results, [](const Results&, const Results& run) {
    return run.contains("summary") && run.at("summary").contains("kitti_vertical_angle_added_deg");
  });
  if (drives.empty())
    return "";
  return fmt::format(
      "The vertical angles in the files of KITTI's drives are too small; {} degrees are added to them, as in other "
      "published figures. Those are means over sequences 11 to 21 of KITTI's odometry benchmark, over "
      "100 to 800 m, lidar alone: LOAM 0.55 %, CT-ICP 0.59 %, IMLS-SLAM 0.69 % "
      "(https://www.cvlibs.net/datasets/kitti/eval_odometry.php). Their sweeps are already corrected for the motion; "
      "those of raw drives are not.\n\n",
      drives.front().at("run").at("summary").at("kitti_vertical_angle_added_deg").get<double>());
}

std::string simulations(const Results& results) {
  std::string text;
  for (const Results& recording : results.at("recordings")) {
    if (recording.contains("simulation"))
      text += fmt::format("- {}: `locus-sim {}`\n", recording.at("recording").get<std::string>(),
                          fmt::join(recording.at("simulation").get<std::vector<std::string>>(), " "));
  }
  return text + '\n';
}

std::string command_of(const Results& results) {
  const auto places = results.at("places").get<std::vector<std::string>>();
  const std::string simulated =
      results.at("simulated") > 0 ? fmt::format(" --simulated --duration {}", results.at("duration_s").get<int>()) : "";
  return fmt::format("locus-experiments --accuracy{}{}{}", simulated, places.empty() ? "" : " ",
                     fmt::join(places, " "));
}

std::string introduction(const Results& results) {
  return fmt::format(
      "# Accuracy on recordings\n\n"
      "`{}`, version {}, {}. Recordings found: {}, of robots or simulators, which "
      "the data do not distinguish. Each is replayed with all its motion sources, with its IMU, and with lidar alone, "
      "where these "
      "differ. Times are those of one thread, {} runs at a time, from the cut of a sweep to its estimate: median and "
      "99th percentile, in real time, which includes other load on the machine, and in processor time.\n\n",
      command_of(results), results.at("version").get<std::string>(), results.at("machine").get<std::string>(),
      results.at("recordings").size() - results.at("simulated").get<std::size_t>(), results.at("jobs").get<int>());
}

constexpr const char* kHowToReadTruth =
    "The error is that of the position, after alignment. *Over 10 m* is the mean error over all sections of that "
    "length, *over 100 to 800 m* the same by the method of KITTI's benchmark. *End* is the error of the last pose with "
    "the first poses aligned, in metres and relative to the distance. *Worst sigma* is the largest error of a position "
    "in standard deviations of its stated covariance; errors below a centimetre are ignored. A run holds if no "
    "position, the last one included, is off by more than 1 % of the distance (3 cm are always allowed, the range "
    "error of such lidars by their data sheets) or by more than 3 sigma, and no sweep failed.\n\n";

constexpr const char* kHowToReadClaims =
    "These have no truth, so the table shows the estimate for the reader to judge: a standing robot must stay at its "
    "pose. *By GPS* is the speed reported by a receiver at the lidar, in its position packets, often of the "
    "second before; the speed of the estimate is that from pose to pose.\n\n";

} // namespace

std::vector<std::string> what_does_not_hold(const Results& run) {
  std::vector<std::string> broken;
  const Results& summary = run.at("summary");
  const double way_m = run.at("way").at("way_m"), end_m = summary.at("end_drift_m");
  const double off_m = std::max(end_m, summary.at("ape_m").at("max").get<double>());
  const double sigma = summary.at("covariance").at("worst_sigma");
  const int failed = summary.at("sweeps").at("failed"), dropped = summary.at("sweeps").at("dropped");
  if (off_m > std::max(kAllowed_m, kAllowedShare * way_m))
    broken.push_back(fmt::format("off by {} m", number(off_m)));
  if (sigma > kAllowedSigma)
    broken.emplace_back("error beyond 3 sigma");
  if (failed + dropped > 0)
    broken.push_back(fmt::format("{} sweep{} failed", failed + dropped, failed + dropped == 1 ? "" : "s"));
  return broken;
}

std::string accuracy_table(const Results& results) {
  const auto is_simulated = [](const Results& recording) { return recording.contains("simulation"); };
  const auto ran = [](const Results& run) { return !run.contains("failed"); };
  const Results known = rows_of(results, [&](const Results& recording, const Results& run) {
    return ran(run) && has_truth(run) && !is_simulated(recording);
  });
  const Results unknown =
      rows_of(results, [&](const Results&, const Results& run) { return ran(run) && !has_truth(run); });
  const Results simulated = rows_of(results, [&](const Results& recording, const Results& run) {
    return ran(run) && has_truth(run) && is_simulated(recording);
  });
  const Results failed = rows_of(results, [&](const Results&, const Results& run) { return !ran(run); });
  return introduction(results) +
         part("With truth", known, kHowToReadTruth + kitti_note(results) + table_with_truth(known)) +
         part("Without truth", unknown, kHowToReadClaims + table_of_claims(unknown)) +
         part("Simulated drives", simulated,
              (known.empty() ? kHowToReadTruth : "") + simulations(results) + table_with_truth(simulated)) +
         part("Not replayed", failed, failures(failed)) + warnings(results);
}

} // namespace locus::experiments
