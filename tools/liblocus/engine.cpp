// SPDX-License-Identifier: Apache-2.0
#include "liblocus/engine.hpp"

#include <algorithm>
#include <span>
#include <stdexcept>
#include <utility>

#include "core/map/surface_map.hpp"
#include "liblocus/estimate_of.hpp"

namespace locus::library {
namespace {

constexpr std::size_t kTalliedSweeps = 100; ///< window of the distributions in the figures

std::vector<std::string> names_of_sources(const Config& config) {
  std::vector<std::string> names;
  for (const MotionSource& source : config.motion_sources)
    names.push_back(source.name);
  return names;
}

std::vector<liblocus::Surface> surfaces_of(std::span<const SurfacePoint> points) {
  std::vector<liblocus::Surface> surfaces(points.size());
  std::ranges::transform(points, surfaces.begin(), [](const SurfacePoint& point) -> liblocus::Surface {
    const Eigen::Vector3f &p = point.position_m, &n = point.normal;
    return {{p.x(), p.y(), p.z()}, {n.x(), n.y(), n.z()}};
  });
  return surfaces;
}

} // namespace

Engine::Engine(Config config, LidarRouter lidars)
    : config_(std::move(config)), source_names_(names_of_sources(config_)), tally_(kTalliedSweeps),
      pipeline_(config_, std::move(lidars),
                [this](const Sweep&, const daemon::ProcessedSweep& done) { add_result(done); }) {}

void Engine::add_result(const daemon::ProcessedSweep& done) {
  tally_.add(done);
  completed_.push_back(estimate_of(done.estimate, source_names_));
}

std::vector<liblocus::Surface> Engine::scan() const { return surfaces_of(pipeline_.processor().odometry().scan()); }

std::vector<liblocus::Surface> Engine::map() const {
  std::vector<SurfacePoint> surfaces;
  read_planes(pipeline_.processor().odometry().map().fine(), surfaces);
  return surfaces_of(surfaces);
}

daemon::Figures Engine::figures() const {
  daemon::Figures figures{.config = config_,
                          .spent = daemon::MachineTime::now() - begin_,
                          .counters = pipeline_.counters(),
                          .sweeps = tally_.figures()};
  figures.ingest.read(pipeline_.ingest());
  return figures;
}

std::string to_json_text(const daemon::Figures& figures) {
  return daemon::to_json(figures).dump(1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

void in_words_of_the_library(const std::function<void()>& work) {
  try {
    work();
  } catch (const std::runtime_error& error) { // a Failure of the tools, or a file system error
    throw liblocus::Error(error.what());
  }
}

} // namespace locus::library
