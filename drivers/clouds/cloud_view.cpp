// SPDX-License-Identifier: Apache-2.0
#include "drivers/clouds/cloud_view.hpp"

namespace locus {

namespace {

using Type = CloudView::Type;

void read_header(MessageReader& reader, CloudView& cloud) {
  if (reader.serialisation() == Serialisation::ros1)
    reader.number<std::uint32_t>(); // the sequence number, which ROS 2 has dropped
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
    reader.number<std::uint32_t>(); // how many: of a vector the first is taken
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

/// Livox' own message: its points are records as well, of 19 bytes, which CDR aligns to 20.
CloudView read_livox_cloud(MessageReader& reader) {
  constexpr std::uint32_t kRecord_bytes = 19, kAligned_bytes = 20;
  CloudView cloud;
  read_header(reader, cloud);
  reader.number<std::uint64_t>(); // the time of the first point, which is the header's
  const auto points = reader.number<std::uint32_t>();
  reader.bytes(4); // number of the lidar, three reserved
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
      count == 0 ? 0 : std::size_t{count - 1} * cloud.point_step + kRecord_bytes; // none is aligned behind the last
  cloud.data = reader.bytes(points == count ? bytes : SIZE_MAX);
  return cloud;
}

} // namespace

std::optional<CloudView> read_cloud(MessageReader reader, std::string_view type) {
  const CloudView cloud = is_livox_type(type) ? read_livox_cloud(reader) : read_point_cloud(reader);
  return reader.whole() ? std::optional{cloud} : std::nullopt;
}

} // namespace locus
