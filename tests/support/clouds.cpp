// SPDX-License-Identifier: Apache-2.0
#include "support/clouds.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include "drivers/files/capture.hpp"
#include "drivers/lidar_input.hpp"
#include "support/returns.hpp"

namespace locus::test {
namespace {

using Type = CloudView::Type;

constexpr Duration kTurn = std::chrono::milliseconds{100};
constexpr std::size_t kRings = 16;

std::uint32_t bytes_of(Type type) {
  constexpr std::array<std::uint32_t, 9> kBytes{0, 1, 1, 2, 2, 4, 4, 4, 8};
  return kBytes[static_cast<std::size_t>(type)];
}

std::vector<OwnCloud::Field> fields_of(CloudKind kind) {
  switch (kind) {
  case CloudKind::velodyne:
  case CloudKind::velodyne_start:
    return {{"x", 0, Type::float32},          {"y", 4, Type::float32},    {"z", 8, Type::float32},
            {"intensity", 12, Type::float32}, {"ring", 16, Type::uint16}, {"time", 18, Type::float32}};
  case CloudKind::ouster:
  case CloudKind::ouster_destaggered:
    return {{"x", 0, Type::float32},          {"y", 4, Type::float32},       {"z", 8, Type::float32},
            {"intensity", 16, Type::float32}, {"t", 20, Type::uint32},       {"reflectivity", 24, Type::uint16},
            {"ring", 26, Type::uint16},       {"ambient", 28, Type::uint16}, {"range", 32, Type::uint32}};
  case CloudKind::hesai:
  case CloudKind::robosense:
    return {{"x", 0, Type::float32},          {"y", 4, Type::float32},          {"z", 8, Type::float32},
            {"intensity", 16, Type::float32}, {"timestamp", 24, Type::float64}, {"ring", 32, Type::uint16}};
  case CloudKind::livox_points:
    return {{"x", 0, Type::float32},          {"y", 4, Type::float32},  {"z", 8, Type::float32},
            {"intensity", 12, Type::float32}, {"tag", 16, Type::uint8}, {"line", 17, Type::uint8},
            {"timestamp", 18, Type::float64}};
  case CloudKind::livox_custom:
    return {{"offset_time", 0, Type::uint32}, {"x", 4, Type::float32},           {"y", 8, Type::float32},
            {"z", 12, Type::float32},         {"reflectivity", 16, Type::uint8}, {"tag", 17, Type::uint8},
            {"line", 18, Type::uint8}};
  case CloudKind::nebula:
    return {{"x", 0, Type::float32},         {"y", 4, Type::float32},          {"z", 8, Type::float32},
            {"intensity", 12, Type::uint8},  {"return_type", 13, Type::uint8}, {"channel", 14, Type::uint16},
            {"azimuth", 16, Type::float32},  {"elevation", 20, Type::float32}, {"distance", 24, Type::float32},
            {"time_stamp", 28, Type::uint32}};
  case CloudKind::bare:
    break;
  }
  return {{"x", 0, Type::float32}, {"y", 4, Type::float32}, {"z", 8, Type::float32}, {"intensity", 12, Type::float32}};
}

std::uint32_t step_of(CloudKind kind) {
  switch (kind) {
  case CloudKind::ouster:
  case CloudKind::ouster_destaggered:
  case CloudKind::hesai:
  case CloudKind::robosense:
    return 48;
  case CloudKind::livox_points:
    return 26;
  case CloudKind::livox_custom:
    return 20;
  case CloudKind::nebula:
    return 32;
  case CloudKind::velodyne:
  case CloudKind::velodyne_start:
    return 22;
  case CloudKind::bare:
    return 16;
  }
  return 0;
}

bool has(const OwnCloud& cloud, const std::string& name) {
  return std::ranges::find(cloud.fields, name, &OwnCloud::Field::name) != cloud.fields.end();
}

/// Writes in the field's own type.
void write(OwnCloud& cloud, std::size_t point, const std::string& name, double value) {
  if (!has(cloud, name))
    return;
  switch (cloud.field(name).type) {
  case Type::uint8:
    return cloud.set(point, name, static_cast<std::uint8_t>(value));
  case Type::uint16:
    return cloud.set(point, name, static_cast<std::uint16_t>(value));
  case Type::uint32:
    return cloud.set(point, name, static_cast<std::uint32_t>(std::llround(value)));
  case Type::float64:
    return cloud.set(point, name, value);
  default:
    return cloud.set(point, name, static_cast<float>(value));
  }
}

void write_point(OwnCloud& cloud, std::size_t at, const FiredPoint& point, CloudKind kind) {
  const bool counts_from_top = kind == CloudKind::ouster || kind == CloudKind::ouster_destaggered ||
                               kind == CloudKind::hesai || kind == CloudKind::nebula;
  const double ring = counts_from_top ? static_cast<double>(kRings) - 1 - point.ring : point.ring;
  const double since_s = to_seconds(point.fired - cloud.stamp), epoch_s = to_seconds(point.fired.time_since_epoch());
  write(cloud, at, "x", static_cast<double>(point.p_m.x()));
  write(cloud, at, "y", static_cast<double>(point.p_m.y()));
  write(cloud, at, "z", static_cast<double>(point.p_m.z()));
  for (const char* const name : {"intensity", "reflectivity"})
    write(cloud, at, name, point.intensity);
  for (const char* const name : {"ring", "line", "channel"})
    write(cloud, at, name, ring);
  write(cloud, at, "time", since_s);
  for (const char* const name : {"t", "time_stamp", "offset_time"})
    write(cloud, at, name, 1e9 * since_s);
  write(cloud, at, "timestamp", kind == CloudKind::livox_points ? static_cast<double>(to_ns(point.fired)) : epoch_s);
}

/// Writes rows of lasers, highest first, and columns of firings. In a staggered image each row begins a few columns
/// later than the one above.
void write_rows(OwnCloud& cloud, const CloudTurn& turn, CloudKind kind) {
  constexpr double kColumn_s = 55.296e-6;
  constexpr std::size_t kShift = 3;
  cloud.height = kRings;
  cloud.width = static_cast<std::uint32_t>(to_seconds(kTurn) / kColumn_s) + 10;
  cloud.data.assign(std::size_t{cloud.height} * cloud.width * cloud.point_step, std::byte{0});
  for (const FiredPoint& point : turn.points) {
    const std::size_t row = kRings - 1 - point.ring;
    std::size_t column = static_cast<std::size_t>(to_seconds(point.fired - turn.begin) / kColumn_s);
    if (kind == CloudKind::ouster_destaggered)
      column = (column + kShift * row) % cloud.width;
    while (cloud.get<float>(row * cloud.width + column, "x") != 0.0F) // a column may begin in the middle of a firing
      column = (column + 1) % cloud.width;
    write_point(cloud, row * cloud.width + column, point, kind);
  }
}

} // namespace

std::vector<CloudTurn> turns_of(const std::filesystem::path& file, std::size_t left_out) {
  LidarOptions options;
  options.time = LidarTime::receive;
  auto lidar = LidarInput::open(options, 0);
  auto capture = Capture::open(file);
  std::vector<CloudTurn> turns;
  while (const Datagram* datagram = capture->next()) {
    const bool is_data = datagram->payload.size() == velodyne::kDataPacketBytes;
    if (datagram->destination_port != options.port || !is_data || left_out > 0) {
      left_out -= is_data && left_out > 0 ? 1 : 0;
      continue;
    }
    const LidarPacket* packet = lidar->receive(*datagram);
    if (packet == nullptr)
      continue;
    if (turns.empty())
      turns.push_back({packet->stamp, {}});
    for (const LidarReturn& r : returns_of(*packet)) {
      const Stamp fired = packet->stamp + Duration{r.offset_ns};
      while (fired >= turns.back().begin + kTurn)
        turns.push_back({turns.back().begin + kTurn, {}});
      turns.back().points.push_back({{r.x_m, r.y_m, r.z_m}, r.ring, r.intensity, fired});
    }
  }
  for (CloudTurn& turn : turns)
    std::ranges::stable_sort(turn.points, {}, &FiredPoint::fired);
  return turns;
}

std::string name_of(CloudKind kind) {
  constexpr std::array<const char*, kCloudKinds> kNames{
      "velodyne",     "velodyne_start", "ouster", "ouster_destaggered", "hesai", "robosense", "livox_points",
      "livox_custom", "nebula",         "bare"};
  return kNames[static_cast<std::size_t>(kind)];
}

CloudView OwnCloud::view() const {
  CloudView message;
  message.stamp = stamp;
  message.frame = frame;
  message.height = height;
  message.width = width;
  message.point_step = point_step;
  message.row_step = width * point_step;
  for (const Field& f : fields)
    message.storage[message.field_count++] = {f.name, f.offset, f.type};
  message.data = data;
  return message;
}

const OwnCloud::Field& OwnCloud::field(const std::string& name) const {
  const auto found = std::ranges::find(fields, name, &Field::name);
  if (found == fields.end())
    throw std::out_of_range("no field " + name);
  return *found;
}

OwnCloud cloud_of(const CloudTurn& turn, CloudKind kind) {
  OwnCloud cloud;
  cloud.stamp = kind == CloudKind::velodyne ? turn.end() : turn.begin;
  cloud.point_step = step_of(kind);
  cloud.fields = fields_of(kind);
  if (kind == CloudKind::ouster || kind == CloudKind::ouster_destaggered) {
    write_rows(cloud, turn, kind);
    return cloud;
  }
  cloud.width = static_cast<std::uint32_t>(turn.points.size());
  cloud.data.resize(std::size_t{cloud.width} * cloud.point_step);
  for (std::size_t i = 0; i < turn.points.size(); ++i)
    write_point(cloud, i, turn.points[i], kind);
  return cloud;
}

void add_field(OwnCloud& cloud, const std::string& name, CloudView::Type type) {
  OwnCloud wider = cloud;
  wider.fields.push_back({name, cloud.point_step, type});
  wider.point_step += bytes_of(type);
  const std::size_t points = cloud.point_step == 0 ? 0 : cloud.data.size() / cloud.point_step;
  wider.data.assign(points * wider.point_step, std::byte{0});
  for (std::size_t i = 0; i < points; ++i)
    std::copy_n(cloud.data.begin() + static_cast<std::ptrdiff_t>(i * cloud.point_step), cloud.point_step,
                wider.data.begin() + static_cast<std::ptrdiff_t>(i * wider.point_step));
  cloud = wider;
}

void remove_field(OwnCloud& cloud, const std::string& name) {
  std::erase_if(cloud.fields, [&](const OwnCloud::Field& field) { return field.name == name; });
}

} // namespace locus::test
