// SPDX-License-Identifier: Apache-2.0
// long_drive SECONDS: simulates a drive of this length of the husky of locus-sim about the plant. Prints as JSON the
// cost of each sixtieth: CPU time from the cut of a sweep to its estimate, and the memory allocated. The last ten are
// also measured with a second pipeline that starts fresh.
#include <algorithm>
#include <cstdlib>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include <fmt/core.h>

#include "held_memory.hpp"
#include "pipeline.hpp"
#include "simulated_robot.hpp"

namespace {

using namespace locus;

constexpr int kParts = 60;
constexpr int kFreshParts = 10;
constexpr int kLeast_s = 12; ///< two sweeps in each part

/// CPU time from the cut, for the sweeps since the previous call.
class Costs {
 public:
  void take(const daemon::ProcessedSweep& sweep) { ms_.push_back(1e3 * to_seconds(sweep.took.cpu)); }

  std::string as_json() {
    if (ms_.empty())
      return "null";
    std::ranges::sort(ms_);
    const auto at = [this](double q) { return ms_[static_cast<std::size_t>(q * static_cast<double>(ms_.size() - 1))]; };
    std::string json = fmt::format("{{\"p50_ms\": {:.4f}, \"p99_ms\": {:.4f}}}", at(0.5), at(0.99));
    ms_.clear();
    return json;
  }

 private:
  std::vector<double> ms_;
};

/// Two pipelines on one drive: one processes all of it, the other only its end.
class Comparison {
 public:
  Comparison(const Config& config, Stamp start, Duration duration)
      : config_(config), start_(start), part_(duration / kParts), before_mb_(performance::held_mb()), whole_(config) {}

  void take(const daemon::Input& input) {
    if (const daemon::ProcessedSweep* sweep = whole_.take(input))
      take(*sweep);
    if (const daemon::ProcessedSweep* sweep = fresh_ ? fresh_->take(input) : nullptr)
      costs_of_fresh_.take(*sweep);
  }

  void print_part() {
    const SurfaceMap& map = whole_.odometry().map();
    ++printed_;
    fmt::print("{}{{\"minute\": {:.3f}, \"whole\": {}, \"fresh\": {}, \"memory_mb\": {:.2f}, \"voxels\": {}, "
               "\"path_m\": {:.0f}}}",
               printed_ == 1 ? "[" : ",\n ", to_seconds(printed_ * part_) / 60.0, costs_.as_json(),
               costs_of_fresh_.as_json(), held_mb_, map.fine().size() + map.coarse().size(), path_m_);
  }

 private:
  void take(const daemon::ProcessedSweep& sweep) {
    if (sweep.estimate.stamp - start_ > (printed_ + 1) * part_)
      print_part();
    if (!fresh_) // the fresh pipeline's memory does not count
      held_mb_ = performance::held_mb() - before_mb_;
    if (!fresh_ && printed_ == kParts - kFreshParts)
      fresh_.emplace(config_);
    const Eigen::Vector3d& p_odom_m = sweep.estimate.T_odom_base.translation;
    path_m_ += (p_odom_m - last_p_odom_m_).norm();
    last_p_odom_m_ = p_odom_m;
    costs_.take(sweep);
  }

  Config config_;
  Stamp start_;
  Duration part_;
  double before_mb_, held_mb_ = 0;
  performance::Pipeline whole_;
  std::optional<performance::Pipeline> fresh_;
  Costs costs_, costs_of_fresh_;
  Eigen::Vector3d last_p_odom_m_ = Eigen::Vector3d::Zero();
  double path_m_ = 0;
  int printed_ = 0;
};

void drive(Duration duration) {
  performance::SimulatedRobot robot(sim::make_urban, {}, duration);
  Comparison comparison(robot.config(), robot.start(), duration);
  constexpr Duration kAtOnce{};
  for (daemon::Input input = robot.next(kAtOnce); !std::holds_alternative<daemon::EndOfInput>(input);
       input = robot.next(kAtOnce))
    comparison.take(input);
  comparison.print_part();
  fmt::print("]\n");
}

} // namespace

int main(int argc, char** argv) {
  const int seconds = argc == 2 ? std::atoi(argv[1]) : 0;
  if (seconds < kLeast_s) {
    fmt::print(stderr, "usage: long_drive SECONDS, {} at the least\n", kLeast_s);
    return 2;
  }
  drive(std::chrono::seconds{seconds});
}
