// SPDX-License-Identifier: Apache-2.0
#include "locus_experiments/results.hpp"

#include <algorithm>
#include <fstream>
#include <string_view>

#include <fmt/format.h>

#include "locus_experiments/accuracy_table.hpp"
#include "locus_experiments/fault_table.hpp"
#include "locus_experiments/harsh_table.hpp"
#include "locus_experiments/matrix_table.hpp"
#include "locus_experiments/subset_table.hpp"
#include "locus_replay/failure.hpp"
#include "locus_replay/output_file.hpp"
#include "pages/data_page.hpp"

// Embedded into the program by locus_page() in CMake.
extern "C" const char locus_experiments_page_begin[]; // NOLINT(modernize-avoid-c-arrays): size set by the linker
extern "C" const char locus_experiments_page_end[];   // NOLINT(modernize-avoid-c-arrays)

namespace locus::experiments {
namespace {

using tools::ExitStatus;
using tools::Failure;

constexpr const char* kFileName = "results.json";

const Results* find(const Results& runs, const std::string& course, std::string_view configuration) {
  const auto found = std::ranges::find_if(runs, [&](const Results& run) {
    return run.at("course") == course && run.at("configuration") == configuration && !run.contains("failed");
  });
  return found == runs.end() ? nullptr : &*found;
}

std::filesystem::path write_table(std::filesystem::path path, const std::string& table) {
  tools::OutputFile file(path);
  file.print("{}", table);
  file.close();
  return path;
}

std::string verdict(const Results& failed, const Results& reference) {
  constexpr double kSilent_s = 1.0, kNegligible_m = 0.2;
  if (failed.at("silent_at_end_s").get<double>() > reference.at("silent_at_end_s").get<double>() + kSilent_s)
    return "Stops";
  const auto max_m = [](const Results& run) { return run.at("summary").at("ape_m").at("max").get<double>(); };
  return max_m(failed) > max_m(reference) + kNegligible_m ? "Errors" : "OK";
}

} // namespace

Results read_results(const std::filesystem::path& file) {
  std::ifstream stream{file};
  Results results = Results::parse(stream, nullptr, false);
  if (!results.is_object() || !results.contains("runs") || !results.at("runs").is_array())
    throw Failure(ExitStatus::failed, fmt::format("{}: no results of locus-experiments; name the results.json in "
                                                  "its output folder (-o)",
                                                  file.string()));
  return results;
}

void judge_robustness(Results& results) {
  Results rows = Results::array();
  const Results& runs = results.at("runs");
  for (const Results& reference : runs) {
    if (reference.at("configuration") != "locusd" || !reference.contains("position_error"))
      continue;
    const auto course = reference.at("course").get<std::string>();
    Results row{{"course", course}};
    for (const char* failure : {"wio_imu_fail", "wio_fail", "lidar_drop"}) {
      if (const Results* run = find(runs, course, failure))
        row[failure] = verdict(*run, reference);
    }
    if (row.size() > 1)
      rows.push_back(std::move(row));
  }
  results["robustness"] = std::move(rows);
}

void judge(Results& results) {
  if (results.contains("faults"))
    judge_faults(results);
  else if (results.contains("matrix"))
    judge_matrix(results);
  else if (results.contains("harsh"))
    judge_harsh(results);
  else
    judge_robustness(results);
}

std::filesystem::path write_results(const std::filesystem::path& folder, const Results& results) {
  const std::string text = results.dump(1, ' ', false, Results::error_handler_t::replace);
  tools::OutputFile json(folder / kFileName);
  json.print("{}\n", text);
  json.close();
  if (results.contains("faults"))
    return write_table(folder / "faults.md", fault_table(results));
  if (results.contains("recordings"))
    return write_table(folder / "accuracy.md", accuracy_table(results));
  if (results.contains("matrix"))
    return write_table(folder / "matrix.md", matrix_table(results));
  if (results.contains("harsh"))
    return write_table(folder / "harsh.md", harsh_table(results));
  if (results.contains("subsets"))
    return write_table(folder / "subsets.md", subset_table(results));
  std::filesystem::path page = folder / "experiments.html";
  tools::write_data_page(page, {locus_experiments_page_begin, locus_experiments_page_end}, results);
  return page;
}

} // namespace locus::experiments
