// SPDX-License-Identifier: Apache-2.0
#include "drivers/clouds/cloud_view.hpp"

namespace locus {

namespace {

using Type = CloudView::Type;

void read_header(MessageReader& reader, CloudView& cloud) {
  if (reader.serialisation() == Serialisation::ros1)
    reader.number<std::uint32_t>(); // sequence number, absent in ROS 2
  const auto seconds = reader.number<std::int32_t>();
  const auto nanoseconds = reader.number<std::uint32_t>();
  cloud.stamp = Stamp{std::chrono::seconds{seconds} + std::chrono::nanoseconds{nanoseconds}};
  cloud.frame = reader.text();
}

void read_fields(MessageReader& reader, CloudView& cloud) {
  for (auto left = reader.number<std::uint32_t>(); left > 0 && reader.whole(); --left) {
    CloudView::Field field;
    field.name = reader.text();
    field.offset = reader.number<std::uint32_t>();
    field.type = static_cast<Type>(reader.number<std::uint8_t>());
    reader.number<std::uint32_t>(); // element count; only the first element of a vector is used
    if (cloud.field_count < CloudView::kMaxFields)
      cloud.storage[cloud.field_count++] = field;
  }
}

CloudView read_point_cloud(MessageReader& reader) {
  CloudView cloud;
  read_header(reader, cloud);
  cloud.height = reader.number<std::uint32_t>();
  cloud.width = reader.number<std::uint32_t>();
  read_fields(reader, cloud);
  cloud.is_big_endian = reader.number<std::uint8_t>() != 0;
  cloud.point_step = reader.number<std::uint32_t>();
  cloud.row_step = reader.number<std::uint32_t>();
  cloud.data = reader.bytes(reader.number<std::uint32_t>());
  return cloud;
}

/// Reads Livox' CustomMsg: records of 19 bytes, aligned to 20 by CDR.
CloudView read_livox_cloud(MessageReader& reader) {
  constexpr std::uint32_t kRecord_bytes = 19, kAligned_bytes = 20;
  CloudView cloud;
  read_header(reader, cloud);
  reader.number<std::uint64_t>(); // time of the first point, equal to the header's stamp
  const auto points = reader.number<std::uint32_t>();
  reader.bytes(4); // lidar number and three reserved bytes
  const auto count = reader.number<std::uint32_t>();
  cloud.height = 1;
  cloud.width = count;
  cloud.point_step = reader.serialisation() == Serialisation::cdr ? kAligned_bytes : kRecord_bytes;
  cloud.storage = {{{"offset_time", 0, Type::uint32},
                    {"x", 4, Type::float32},
                    {"y", 8, Type::float32},
                    {"z", 12, Type::float32},
                    {"reflectivity", 16, Type::uint8},
                    {"tag", 17, Type::uint8},
                    {"line", 18, Type::uint8}}};
  cloud.field_count = 7;
  const std::size_t bytes =
      count == 0 ? 0 : std::size_t{count - 1} * cloud.point_step + kRecord_bytes; // no padding after the last record
  cloud.data = reader.bytes(points == count ? bytes : SIZE_MAX);
  return cloud;
}

} // namespace

std::optional<CloudView> read_cloud(MessageReader reader, std::string_view type) {
  const CloudView cloud = is_livox_type(type) ? read_livox_cloud(reader) : read_point_cloud(reader);
  return reader.whole() ? std::optional{cloud} : std::nullopt;
}

} // namespace locus
