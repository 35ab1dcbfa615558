// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/ingest/lidar_packet.hpp"
#include "core/sources/source_clock.hpp"
#include "drivers/clouds/cloud_counters.hpp"
#include "drivers/clouds/cloud_doubt.hpp"
#include "drivers/clouds/cloud_layout.hpp"
#include "drivers/clouds/cloud_view.hpp"
#include "drivers/clouds/point_times.hpp"
#include "drivers/clouds/rings.hpp"

namespace locus {

/// Turns the clouds of one lidar into packets, as if it had sent them: slices of a millisecond or so, in the order of
/// time, each return at the place of its ring.
///
/// Times of points are told as PointTimes and PointTimesFrom have it; stamps are put on the host's clock as those of a
/// motion source are (SourceClock). A cloud without a single return is a cloud. Memory is asked for at construction and
/// touched as clouds need it. Allocates nothing after that, throws nothing. One owner.
class CloudDecoder {
 public:
  explicit CloudDecoder(std::uint8_t lidar, PointTimesFrom times = PointTimesFrom::automatic);

  /// Begins with the packets of a cloud, of which nothing is needed after this; why not, if it is refused. `arrival`:
  /// when it reached this computer.
  std::optional<CloudError> begin(const CloudView& message, Stamp arrival);
  /// Counts what came and could not be read.
  CloudError refuse(CloudError error);

  /// The next packet, valid until the next call; nullptr after the last of the cloud.
  const LidarPacket* next();

  [[nodiscard]] const CloudCounters& counters() const { return counters_; }
  /// All that was met so far.
  [[nodiscard]] CloudDoubts doubts() const { return doubts_; }
  /// By doubt: when the last cloud arrived that gave rise to it; Stamp{} before the first.
  [[nodiscard]] const std::array<Stamp, kCloudDoubts>& last_doubted() const { return last_doubted_; }
  /// Of the latest cloud.
  [[nodiscard]] PointTiming timing() const { return timing_; }
  [[nodiscard]] RingsFrom rings() const { return rings_.from(); }
  /// Between the begins of two clouds; 100 ms before the second.
  [[nodiscard]] Duration period() const { return period_; }
  /// When the last cloud that was used arrived; Stamp{} before the first.
  [[nodiscard]] Stamp last_heard() const { return last_heard_; }

 private:
  struct Counted {
    std::size_t points = 0, nan = 0, origin = 0, untimed = 0;
  };

  void count(const Counted& counted);
  void doubt(CloudDoubt doubt, Stamp arrival) {
    doubts_.set(static_cast<std::size_t>(doubt));
    last_doubted_[static_cast<std::size_t>(doubt)] = arrival;
  }
  void read(const CloudView& message, const CloudLayout& layout);
  Counted keep_returns();
  Stamp time_points(const CloudView& message, const CloudLayout& layout, Stamp arrival);
  bool understand_times(bool has_times, Stamp arrival);
  bool time_by_azimuth();
  Stamp stamped_at_begin(Stamp begin, Stamp header, Stamp arrival);
  std::optional<Stamp> on_host_clock(Stamp begin, Duration length, Stamp arrival);
  void measure_period();
  void sort_by_time();
  FiringGroup* group_for(std::size_t laser);
  void put(std::size_t point, FiringGroup& group, std::int32_t begin_ns) const;

  /// One array per figure, in the order of the message; after keep_returns() of the returns alone.
  struct Points {
    std::vector<float> x_m, y_m, z_m, intensity, ring;
    std::vector<double> time; ///< as the message has them
    std::vector<std::uint8_t> laser;
    std::vector<std::int32_t> offset_ns; ///< from the begin of the cloud
    std::vector<std::uint32_t> order;    ///< by time
  };

  /// What the header's stamp is that of: the first point, or the last one.
  struct StampedAt {
    bool known = false, end = false;
    int confirming = 0; ///< clouds that say so, up to those it takes
    int contrary = 0;   ///< clouds in a row that say otherwise
  };

  PointTimesFrom times_from_;
  Points points_;
  Rings rings_;
  std::vector<std::uint32_t> buckets_; ///< of time, for sorting
  std::optional<CloudLayout> layout_;  ///< of the cloud before
  std::optional<PointTimes> times_;    ///< as understood last, in that layout
  std::uint64_t unit_votes_ = 0;       ///< clouds in which its unit made a turn, less those it made too short for one
  StampedAt stamped_at_;               ///< in that layout
  SourceClock clock_;
  PointTiming timing_ = PointTiming::field;

  LidarPacket::Cloud cloud_; ///< the one at hand
  std::size_t next_ = 1;     ///< place in points_.order
  LidarPacket packet_;
  std::array<FiringGroup*, LidarPacket::kMaxLasers / FiringGroup::kLasers> open_{}; ///< by bank, of the packet at hand

  Duration period_ = std::chrono::milliseconds{100};
  bool period_is_known_ = false;
  std::optional<Stamp> last_begin_;
  std::optional<Stamp> last_stamp_; ///< of the header
  std::uint64_t last_digest_ = 0;
  Stamp last_heard_;
  CloudCounters counters_;
  CloudDoubts doubts_;
  std::array<Stamp, kCloudDoubts> last_doubted_{};
};

} // namespace locus
