// SPDX-License-Identifier: Apache-2.0
#include "core/motion_sources.hpp"

namespace locus {

MotionSources::MotionSources(const std::vector<MotionSourceOptions>& options, Fusion fusion)
    : fusion_(fusion), tracks_(options.begin(), options.end()) {}

SourceChoice MotionSources::choose(Stamp now) const {
  return choose_sources([this](std::size_t i) { return tracks_[i].kind(); }, tracks_.size(), fusion_,
                        [&](std::size_t i) { return tracks_[i].is_live(now); });
}

std::optional<Pose> MotionSources::motion(const SourceChoice& choice, Stamp from, Stamp to) const {
  const auto step = [&](std::size_t source) -> std::optional<Pose> {
    const std::optional<Pose> T_source_from = tracks_[source].at(from);
    const std::optional<Pose> T_source_to = tracks_[source].at(to);
    if (!T_source_from || !T_source_to)
      return std::nullopt;
    return T_source_from->inverse() * *T_source_to;
  };
  if (!choice.rotation)
    return Pose{};
  std::optional<Pose> T_from_to = step(*choice.rotation);
  if (!T_from_to || !choice.translation || choice.translation == choice.rotation)
    return T_from_to;
  const std::optional<Pose> moved = step(*choice.translation);
  if (!moved)
    return std::nullopt;
  T_from_to->translation = moved->translation;
  return T_from_to;
}

void MotionSources::describe(Sweep& sweep) const {
  sweep.specific_force_base_mps2.reset();
  for (std::size_t i = 0; i < sweep.sources.size(); ++i) {
    sweep.sources[i] = SourcePose{};
    if (i >= tracks_.size() || !tracks_[i].has_sample_in(sweep.start, sweep.end))
      continue;
    const std::optional<Pose> T_source_base = tracks_[i].at(sweep.end);
    if (!T_source_base)
      continue;
    sweep.sources[i] = {true, *T_source_base};
    if (!sweep.specific_force_base_mps2)
      sweep.specific_force_base_mps2 = tracks_[i].mean_specific_force_mps2(sweep.start, sweep.end);
  }
}

} // namespace locus
