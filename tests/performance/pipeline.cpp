// SPDX-License-Identifier: Apache-2.0
#include "pipeline.hpp"

#include <stdexcept>
#include <string>
#include <utility>
#include <variant>

namespace locus::performance {

namespace {

LidarRouter open_lidars(const Config& config) {
  Expected<LidarRouter, std::string> lidars = LidarRouter::open(config.lidars);
  if (!lidars)
    throw std::runtime_error(lidars.error());
  return std::move(*lidars);
}

} // namespace

Pipeline::Pipeline(const Config& config)
    : hears_motion_(!config.motion_sources.empty()), processor_(config),
      ingest_(config, open_lidars(config), [this](Sweep& sweep, const daemon::SweepCut& cut) { process(sweep, cut); }) {
}

void Pipeline::process(Sweep& sweep, const daemon::SweepCut& cut) {
  processed_ = processor_.process(sweep, cut);
  std::swap(points_, sweep.points);
  ingest_.apply(processor_.odometry().feedback());
  processor_.prepare_next();
}

const daemon::ProcessedSweep* Pipeline::take(const daemon::Input& input) {
  processed_.reset();
  if (hears_motion_ || std::holds_alternative<Datagram>(input))
    ingest_.process(input);
  return processed_ ? &*processed_ : nullptr;
}

daemon::StageTimes Pipeline::stages() const {
  daemon::StageTimes totals;
  for (std::size_t stage = 0; stage < kStages; ++stage)
    totals[stage] =
        ingest_.stages().total(static_cast<Stage>(stage)) + processor_.stages().total(static_cast<Stage>(stage));
  return totals;
}

} // namespace locus::performance
