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

/// Converts the clouds of one lidar to packets, as if it had sent them: slices of about a millisecond in time order,
/// with each return in the slot of its laser.
///
/// Point times are interpreted according to PointTimes and PointTimesFrom; stamps are converted to the host's clock as
/// those of a motion source (SourceClock). A cloud without returns is valid. Clouds of another frame are another
/// lidar's, and accepted only after one second without any of this frame. Memory is reserved at construction, and
/// touched as clouds need it; after that, allocates nothing and throws nothing. Single owner, not thread-safe.
class CloudDecoder {
 public:
  explicit CloudDecoder(std::uint8_t lidar, PointTimesFrom times = PointTimesFrom::automatic);

  /// Starts decoding a cloud; `message` is not used after the call. `arrival`: reception on this computer. Returns the
  /// reason if the cloud is rejected.
  std::optional<CloudError> begin(const CloudView& message, Stamp arrival);
  /// Counts a received cloud as rejected and returns `error`.
  CloudError refuse(CloudError error);

  /// Returns the next packet, valid until the next call; nullptr after the last packet of the cloud.
  const LidarPacket* next();

  [[nodiscard]] const CloudCounters& counters() const { return counters_; }
  /// Problems found in any cloud so far.
  [[nodiscard]] CloudDoubts doubts() const { return doubts_; }
  /// Arrival of the latest cloud with each problem; Stamp{} before the first.
  [[nodiscard]] const std::array<Stamp, kCloudDoubts>& last_doubted() const { return last_doubted_; }
  /// Time source of the points of the latest cloud.
  [[nodiscard]] PointTiming timing() const { return timing_; }
  [[nodiscard]] RingsFrom rings() const { return rings_.from(); }
  /// Smoothed time from the start of one cloud to the next; 100 ms before the second cloud.
  [[nodiscard]] Duration period() const { return period_; }
  /// Arrival of the latest accepted cloud; Stamp{} before the first.
  [[nodiscard]] Stamp last_received() const { return last_received_; }

 private:
  struct Counted {
    std::size_t points = 0, nan = 0, origin = 0, untimed = 0;
  };

  [[nodiscard]] bool is_of_another_lidar(std::size_t frame, Stamp arrival) const;
  void count(const Counted& counted);
  void doubt(CloudDoubt doubt, Stamp arrival) {
    doubts_.set(static_cast<std::size_t>(doubt));
    last_doubted_[static_cast<std::size_t>(doubt)] = arrival;
  }
  void read(const CloudView& message, const CloudLayout& layout);
  Counted keep_returns();
  Stamp time_points(const CloudView& message, const CloudLayout& layout, Stamp arrival);
  bool understand_times(bool has_times, Stamp arrival);
  [[nodiscard]] bool spans_too_little(const PointTimes& times) const;
  bool time_by_azimuth(Duration turn);
  void time_by_place(const CloudView& message);
  Stamp stamped_at_begin(Stamp begin, Stamp header, Stamp arrival);
  std::optional<Stamp> on_host_clock(Stamp begin, Duration length, Stamp arrival);
  void measure_period(Stamp arrival);
  void sort_by_time();
  FiringGroup* group_for(std::size_t laser);
  void add_point(std::size_t point, FiringGroup& group, std::int32_t begin_ns) const;

  /// Point data, one array per quantity in the order of the message; only returns after keep_returns().
  struct Points {
    std::vector<float> x_m, y_m, z_m, intensity, ring;
    std::vector<double> time; ///< raw numbers of the message
    std::vector<std::uint8_t> laser;
    std::vector<std::int32_t> offset_ns; ///< from the start of the cloud
    std::vector<std::uint32_t> order;    ///< indices sorted by time
  };

  /// Point that the header's stamp refers to: the first or the last one.
  struct StampedAt {
    bool known = false, end = false;
    int confirming = 0; ///< clouds that confirm it, up to the evidence required
    int contrary = 0;   ///< consecutive clouds that contradict it
  };

  PointTimesFrom times_from_;
  Points points_;
  Rings rings_;
  std::vector<std::uint32_t> buckets_; ///< counts for the time sort
  std::optional<CloudLayout> layout_;  ///< layout of the previous cloud
  std::optional<PointTimes> times_;    ///< latest interpretation in that layout
  std::uint64_t unit_votes_ = 0;       ///< clouds whose span in its unit is a turn, minus those with too short a span
  StampedAt stamped_at_;               ///< evidence in that layout
  SourceClock clock_;
  PointTiming timing_ = PointTiming::field;

  LidarPacket::Cloud cloud_; ///< current cloud
  Stamp zero_;               ///< instant of offset 0 in it
  std::size_t next_ = 1;     ///< index into points_.order
  LidarPacket packet_;
  std::array<FiringGroup*, LidarPacket::kMaxLasers / FiringGroup::kLasers> open_{}; ///< indexed by bank, current packet

  Duration period_ = std::chrono::milliseconds{100};
  bool period_is_known_ = false;
  std::optional<Stamp> last_begin_;
  int standing_still_ = 0;          ///< consecutive clouds that begin no later than the one before
  std::optional<Stamp> last_stamp_; ///< header stamp
  std::uint64_t last_digest_ = 0;
  std::size_t frame_ = 0; ///< hash of the frame's name
  Stamp last_received_;
  CloudCounters counters_;
  CloudDoubts doubts_;
  std::array<Stamp, kCloudDoubts> last_doubted_{};
};

} // namespace locus
