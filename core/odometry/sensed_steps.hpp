// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>

#include "core/base/pose.hpp"
#include "core/base/stamp.hpp"
#include "core/ingest/sweep.hpp"

namespace locus {

/// Motion from one processed sweep to the next as measured by each source, however many sweeps were dropped in between
/// (paper II-B.1). One owner.
class SensedSteps {
 public:
  /// Stores the processed `sweep` as the last one.
  void store(const Sweep& sweep) {
    last_ = sweep.end;
    sources_ = sweep.motion.sources;
  }

  [[nodiscard]] Stamp last() const { return last_; } ///< end of the last sweep
  [[nodiscard]] double elapsed_s(const Sweep& sweep) const { return to_seconds(sweep.end - last_); }

  /// Returns the mean twist of the base since the last sweep; nothing if the source did not measure it.
  [[nodiscard]] std::optional<SensedTwist> twist_base(const Sweep& sweep, SourceId source) const {
    const SourcePose& last = sources_[index_of(source)];
    const SourcePose& now = sweep.motion.sources[index_of(source)];
    if (!last.known || !now.known || last.epoch != now.epoch || elapsed_s(sweep) <= 0.0)
      return std::nullopt;
    SensedTwist sensed(se3_log(last.T_source_base.inverse() * now.T_source_base) / elapsed_s(sweep));
    sensed.change_per_s = (now.twist_base - last.twist_base) / elapsed_s(sweep);
    sensed.brought_forward =
        (to_seconds(now.late) * now.twist_base - to_seconds(last.late) * last.twist_base) / elapsed_s(sweep);
    return sensed;
  }
  /// Returns whether there is such a twist and the source was healthy at both ends.
  [[nodiscard]] bool is_usable(const Sweep& sweep, SourceId source) const {
    return sources_[index_of(source)].usable && sweep.motion.sources[index_of(source)].usable &&
           twist_base(sweep, source);
  }
  /// Returns whether a source repeats its pose but for rounding, as an odometry does at rest or when it is stuck.
  [[nodiscard]] bool repeats(const Sweep& sweep, SourceId source) const {
    constexpr double kRounding = 1e-6; ///< m/s and rad/s
    const auto sensed = twist_base(sweep, source);
    return sensed && sensed->mean.cwiseAbs().maxCoeff() < kRounding;
  }

 private:
  Stamp last_;
  std::array<SourcePose, kMaxSources> sources_;
};

} // namespace locus
