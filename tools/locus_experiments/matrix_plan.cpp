// SPDX-License-Identifier: Apache-2.0
#include "locus_experiments/matrix_plan.hpp"

#include <algorithm>
#include <array>

#include <fmt/format.h>

namespace locus::experiments {
namespace {

constexpr const char* kLidar = "top";
constexpr const char* kPositionPackets = "top.position";

struct Kind {
  const char *what, *fault; ///< KIND[=VALUE]
};
constexpr Kind kAbsent{"absent", "lost"}, kReturns{"absent, then back", "lost"}, kLate{"0.2 s late", "late=0.2"},
    kFrozen{"frozen", "frozen"}, kJumping{"jumping, 2 m or 2 rad/s", "jump=2"}, kNan{"NaN", "nan"};
constexpr std::array kKinds{kAbsent,
                            kLate,
                            Kind{"0.2 s early: stamped ahead", "clock-step=0.2"},
                            Kind{"duplicated, 10 %", "duplicate=10"},
                            Kind{"reordered, 10 %", "reorder=10"},
                            Kind{"corrupt, 10 %", "corrupt=10"},
                            kFrozen,
                            kJumping,
                            kNan,
                            Kind{"clock 600 s forward", "clock-step=600"},
                            Kind{"clock 600 s back", "clock-step=-600"},
                            kReturns};

bool is(const Kind& kind, const Kind& other) { return kind.what == other.what; }

std::string why_impossible(const std::string& input, const Kind& kind) {
  if (input == kPositionPackets && is(kind, kJumping))
    return "no value that is used can jump";
  if (is(kind, kNan) && (input == kLidar || input == kPositionPackets))
    return "packets have no floating-point numbers";
  return "";
}

Interval interval_of(const Kind& kind, bool from_start, int duration_s) {
  const int third_s = duration_s / 3, minute_s = std::min(60, duration_s / 2);
  if (from_start)
    return {0, is(kind, kReturns) ? minute_s : duration_s};
  return {third_s, is(kind, kAbsent) ? duration_s : third_s + minute_s};
}

/// Builds the SPECs. A lasting jump would be a valid change of the frame's origin: it lasts one second in five.
std::vector<std::string> specs(const std::string& input, const Kind& kind, const Interval& lasting, int duration_s) {
  const auto spec = [&](int from_s) { return fmt::format("{}:{}@{}", input, kind.fault, from_s); };
  if (!is(kind, kJumping))
    return {lasting.until_s == duration_s ? spec(lasting.from_s)
                                          : fmt::format("{}-{}", spec(lasting.from_s), lasting.until_s)};
  std::vector<std::string> all;
  for (int from_s = lasting.from_s; from_s < lasting.until_s; from_s += 5)
    all.push_back(fmt::format("{}-{}", spec(from_s), from_s + 1));
  return all;
}

/// Distance that a husky drives while a packet is late.
constexpr double kWayWhileLate_m = 0.2;

/// Sets the demand without a lidar: the motion sources bridge the gap, with their drift.
void expect_of_lidar(const Kind& kind, MatrixCell& cell) {
  if (is(kind, kAbsent) && cell.from_start)
    cell.refusal = "no valid data packet";
  if (is(kind, kReturns) && cell.from_start) {
    cell.silent_from_s = cell.lasting.until_s;
  } else if (is(kind, kLate)) { // stamps are late, so the pose lags by the distance driven
    cell.demand = Demand::accurate;
    cell.limit = kWayWhileLate_m;
  } else if (is(kind, kAbsent) || is(kind, kReturns) || is(kind, kFrozen) || is(kind, kJumping)) {
    cell.demand = Demand::carried;
    cell.limit = 1.5;
  }
}

MatrixCell cell_of(const std::string& input, const Kind& kind, bool from_start, int duration_s) {
  constexpr double kWithin = 0.2;
  MatrixCell cell;
  cell.input = input;
  cell.what = kind.what;
  cell.from_start = from_start;
  cell.lasting = interval_of(kind, from_start, duration_s);
  cell.limit = kWithin;
  cell.impossible = why_impossible(input, kind);
  if (cell.impossible.empty())
    cell.faults = specs(input, kind, cell.lasting, duration_s);
  if (input == kLidar)
    expect_of_lidar(kind, cell);
  return cell;
}

} // namespace

std::string MatrixCell::configuration() const {
  std::string name = fmt::format("{} {} {}", input, what, from_start ? "start" : "mid");
  const auto is_word = [](char c) { return c == '.' || c == '-' || (c >= '0' && c <= '9') || (c >= 'A' && c <= 'z'); };
  std::ranges::replace_if(
      name, [&](char c) { return !is_word(c); }, '_');
  return name;
}

std::vector<MatrixCell> matrix_cells(int duration_s) {
  std::vector<MatrixCell> cells;
  for (const char* input : {kLidar, kPositionPackets, "wio", "imu"}) {
    for (const Kind& kind : kKinds) {
      for (const bool from_start : {true, false})
        cells.push_back(cell_of(input, kind, from_start, duration_s));
    }
  }
  return cells;
}

Plan plan_of_matrix(const Arguments& arguments) {
  Plan plan;
  plan.courses.push_back(course_of_kind(arguments, kMatrixCourse, 1));
  plan.runs.push_back({matrix_course(), kNoFault, {}});
  for (const MatrixCell& cell : matrix_cells(arguments.duration_s)) {
    if (cell.faults.empty())
      continue;
    Run run{matrix_course(), cell.configuration(), {}};
    for (const std::string& fault : cell.faults)
      run.options.insert(run.options.end(), {"--fail", fault});
    run.watched = {std::max(1, cell.lasting.from_s), cell.lasting.until_s}; // an error adds to the existing one
    run.refusal = cell.refusal;
    plan.runs.push_back(std::move(run));
  }
  return plan;
}

std::string matrix_course() { return fault_course(kMatrixCourse, 1); }

} // namespace locus::experiments
