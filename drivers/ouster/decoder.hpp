// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/base/isa.hpp"
#include "core/base/stamp.hpp"
#include "core/ingest/lidar_packet.hpp"
#include "drivers/ouster/metadata.hpp"
#include "drivers/packet_counters.hpp"

namespace locus::ouster {

/// Decodes the lidar packets of one sensor, described by its Metadata, into returns in the sensor frame.
///
/// All pixels of a column share its time and its encoder angle, which follows from its measurement ID (consistent with
/// the encoder of legacy packets: 88 ticks per column of 1024). Sixteen pixels form a firing group; dual profiles have
/// one group for each return, the strongest first. Columns with an invalid status are skipped: those outside the
/// transmitted window, and those that the sensor did not measure.
///
/// Packets with another serial number are rejected if both packet and metadata have one. After a restart, the sensor
/// may be in another mode than its metadata: packets are then rejected (model) until a turn has shown that measurement
/// IDs and their rate match the metadata. Once the checksum of a sensor has been correct, packets with a wrong one are
/// rejected; older firmware writes arbitrary bytes there.
///
/// Single owner, not thread-safe. Allocates nothing and throws nothing after construction. A rejected packet leaves the
/// decoder unchanged, except for its knowledge of restarts.
class Decoder {
 public:
  explicit Decoder(const Metadata& metadata, Isa isa = best_isa());

  /// Fills all of `packet` except `lidar` and `stamp`. Returns the reason for rejection, if any; `packet` is then
  /// undefined: length (no lidar packet of this sensor), flag (another packet type, or no valid column), sender
  /// (another serial number), checksum, model (see above), azimuth (measurement IDs out of range or not consecutive),
  /// time (column times out of range or not increasing).
  std::optional<PacketError> decode(std::span<const std::byte> payload, LidarPacket& packet);

  /// Time of the first valid column of the last good packet, in the sensor's clock with its arbitrary epoch. >= 0.
  [[nodiscard]] Duration time() const { return time_; }
  /// Measurement IDs of the first and the last valid column of the last good packet.
  [[nodiscard]] std::size_t first_column() const { return first_column_; }
  [[nodiscard]] std::size_t last_column() const { return last_column_; }

  /// Rotation rate from the times of the columns of the last good packet that had several; 0 before it. At the edge of
  /// a window a packet may have a single one.
  [[nodiscard]] double rotation_rate_rpm() const { return rotation_rate_rpm_; }

  /// Returns the number of packets sent between one whose first column had this ID and the last good one, `advance`
  /// later; 0 if IDs and time disagree.
  [[nodiscard]] std::uint64_t packets_between(std::size_t first_column_before, Duration advance) const;

  /// Invalid columns skipped so far within the transmitted window.
  [[nodiscard]] std::uint64_t invalid_columns() const { return invalid_columns_; }
  [[nodiscard]] bool has_checksums() const { return has_checksums_; }
  /// Packets rejected since the last good one because the sensor was restarted after its metadata was written.
  [[nodiscard]] std::uint64_t packets_of_other_start() const { return packets_of_other_start_; }
  /// Returns true if these span so many turns that the sensor must be in another mode.
  [[nodiscard]] bool is_in_other_mode() const { return packets_of_other_start_ > 2 * packets_per_turn_; }

  [[nodiscard]] const PacketFormat& format() const { return format_; }
  [[nodiscard]] Duration column_duration() const { return column_duration_; }
  [[nodiscard]] const Metadata& metadata() const { return metadata_; }

  static constexpr std::size_t kMaxColumns = 32;

 private:
  using Packet = std::span<const std::byte>;
  template <class T> using PerPixel = std::array<T, kMaxPixels>;
  using Ranges = FiringGroup::PerLaser<std::int32_t>;

  /// Beam directions in the frame of their column: the lidar frame rotated by the encoder angle.
  struct Beams {
    PerPixel<float> x, y, z;
    PerPixel<std::uint8_t> ring;
  };
  struct Turn {
    float cos = 1.0F, sin = 0.0F;
  };
  /// Transform from the frame of a column to the sensor frame.
  struct ColumnPose {
    std::array<std::array<float, 3>, 3> R;
    std::array<float, 3> t;
  };
  struct Column {
    const std::byte* at;
    std::size_t measurement_id;
    std::int32_t offset_ns;
  };
  /// Packet from another start of the sensor.
  struct OtherStart {
    std::uint32_t init_id = 0;
    std::uint16_t frame_id = 0;
    std::size_t first_column = 0;
    Duration time{};
  };

  void aim_beams();
  std::optional<PacketError> find_columns(Packet payload);
  bool has_known_mode(const PacketHeader& header);
  [[nodiscard]] bool has_known_spacing() const;
  [[nodiscard]] std::size_t columns_between(std::size_t from, std::size_t to) const;
  [[nodiscard]] bool is_in_window(std::size_t measurement_id) const;
  [[nodiscard]] std::uint64_t sent_after(std::size_t packet, std::size_t packets) const;
  [[nodiscard]] ColumnPose pose_of(std::size_t measurement_id) const;
  void read_column(const Column& column, LidarPacket& out) const;
  void place(const Ranges& ranges_mm, const Ranges& previous_mm, const ColumnPose& pose, std::size_t first_pixel,
             FiringGroup& group) const;

  Metadata metadata_;
  PacketFormat format_;
  Isa isa_;
  Duration column_duration_;
  float beam_origin_radius_m_, beam_origin_height_m_;
  float beam_origin_m_; ///< distance of the beam origin from the lidar frame's centre; included in ranges
  Beams beams_{};
  std::vector<Turn> encoder_; ///< indexed by measurement ID
  std::array<std::array<float, 3>, 3> R_sensor_lidar_{};
  std::array<float, 3> t_sensor_lidar_{};
  int azimuth_zero_cdeg_; ///< azimuth of measurement ID 0, clockwise from the sensor's x axis

  std::array<Column, kMaxColumns> columns_{}; ///< valid columns of the current packet
  std::size_t column_count_ = 0;
  std::uint64_t columns_missing_ = 0; ///< its invalid columns in the window
  Duration time_of_packet_{};

  Duration time_{};
  std::size_t first_column_ = 0, last_column_ = 0;
  double rotation_rate_rpm_ = 0.0;
  std::uint64_t invalid_columns_ = 0, packets_of_other_start_ = 0;
  std::uint64_t packets_per_turn_; ///< packets that the sensor sends per turn
  bool has_checksums_ = false;
  OtherStart other_start_;
};

} // namespace locus::ouster
