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

/// Turns lidar packets of the sensor that a Metadata is of into returns in its sensor frame.
///
/// All pixels of a column share its time and its encoder angle, which follows from its measurement id (the encoder of
/// legacy packets says the same: 88 ticks a column of 1024). Sixteen pixels make a firing group, in dual profiles one
/// for each return, the strongest first. Columns that their status calls invalid are left out: what lies outside the
/// window that is sent, and what the sensor did not measure.
///
/// A packet is held to the sensor's serial number, where it and the metadata have one. One of another start of the
/// sensor than the metadata is of may come in another mode: such packets are refused (model) until a turn has shown
/// that the measurement ids count as the metadata says, and as fast. A sensor whose checksum has been right once is
/// held to it from then on; older firmware fills its place with anything.
///
/// One owner. Allocates nothing, throws nothing after construction. A packet that is refused leaves the decoder as it
/// was, but for what it knows of other starts of the sensor.
class Decoder {
 public:
  explicit Decoder(const Metadata& metadata, Isa isa = best_isa());

  /// Fills everything of `packet` but lidar and stamp, or says why not and leaves `packet` undefined: length (not of a
  /// lidar packet of this sensor), flag (of another type, or no column is valid), sender (another serial number),
  /// checksum, model (see above), azimuth (measurement ids that are none or do not follow each other), time (columns
  /// that do not follow each other).
  std::optional<PacketError> decode(std::span<const std::byte> payload, LidarPacket& packet);

  /// Of the last good packet: when its first valid column was, by the sensor's clock, whatever that counts from. >= 0.
  [[nodiscard]] Duration time() const { return time_; }
  /// Of the last good packet: the measurement ids of its first and its last valid column.
  [[nodiscard]] std::size_t first_column() const { return first_column_; }
  [[nodiscard]] std::size_t last_column() const { return last_column_; }

  /// Of the last good packet, from the times of its columns.
  [[nodiscard]] double rotation_rate_rpm() const;

  /// How many packets lie between one whose first column had this id and the last good one, `advance` later, that the
  /// sensor sends; none where the ids and the time do not tell of the same gap.
  [[nodiscard]] std::uint64_t packets_between(std::size_t first_column_before, Duration advance) const;

  /// Left out so far, within the window that is sent.
  [[nodiscard]] std::uint64_t invalid_columns() const { return invalid_columns_; }
  [[nodiscard]] bool has_checksums() const { return has_checksums_; }
  /// Packets since the last good one that were refused because the sensor has been started anew since its metadata was
  /// written.
  [[nodiscard]] std::uint64_t packets_of_other_start() const { return packets_of_other_start_; }
  /// Whether these are so many turns that the sensor must be in another mode.
  [[nodiscard]] bool is_in_other_mode() const { return packets_of_other_start_ > 2 * packets_per_turn_; }

  [[nodiscard]] const PacketFormat& format() const { return format_; }
  [[nodiscard]] Duration column_duration() const { return column_duration_; }
  [[nodiscard]] const Metadata& metadata() const { return metadata_; }

  static constexpr std::size_t kMaxColumns = 32;

 private:
  using Packet = std::span<const std::byte>;
  template <class T> using PerPixel = std::array<T, kMaxPixels>;
  using Ranges = FiringGroup::PerLaser<std::int32_t>;

  /// Where the beams point in the frame of their column, which is the lidar frame turned by the encoder angle.
  struct Beams {
    PerPixel<float> x, y, z;
    PerPixel<std::uint8_t> ring;
  };
  struct Turn {
    float cos = 1.0F, sin = 0.0F;
  };
  /// From the frame of a column to the sensor's.
  struct ColumnPose {
    std::array<std::array<float, 3>, 3> R;
    std::array<float, 3> t;
  };
  struct Column {
    const std::byte* at;
    std::size_t measurement_id;
    std::int32_t offset_ns;
  };
  /// A packet of another start of the sensor.
  struct OtherStart {
    std::uint32_t init_id = 0;
    std::uint16_t frame_id = 0;
    std::size_t first_column = 0;
    Duration time{};
  };

  void aim_beams();
  std::optional<PacketError> find_columns(Packet payload);
  bool turns_as_known(const PacketFormat::Header& header);
  [[nodiscard]] bool is_spaced_as_known() const;
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
  float beam_origin_m_; ///< from the centre of the lidar frame: so much of a range lies before the beam's origin
  Beams beams_{};
  std::vector<Turn> encoder_; ///< by measurement id
  std::array<std::array<float, 3>, 3> R_sensor_lidar_{};
  std::array<float, 3> t_sensor_lidar_{};
  int azimuth_zero_cdeg_; ///< of measurement id 0, clockwise from the sensor's x axis

  std::array<Column, kMaxColumns> columns_{}; ///< of the packet at hand: the valid ones
  std::size_t column_count_ = 0;
  std::uint64_t columns_missing_ = 0; ///< of them in the window
  Duration time_of_packet_{};

  Duration time_{};
  std::size_t first_column_ = 0, last_column_ = 0;
  Duration spanned_{}; ///< from the first of them to the last
  std::uint64_t invalid_columns_ = 0, packets_of_other_start_ = 0;
  std::uint64_t packets_per_turn_; ///< that it sends
  bool has_checksums_ = false;
  OtherStart other_start_;
};

} // namespace locus::ouster
