// SPDX-License-Identifier: Apache-2.0
#include "drivers/ouster/metadata.hpp"

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <fstream>
#include <limits>
#include <optional>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "core/ingest/lidar_packet.hpp"
#include "drivers/ouster/metadata_document.hpp"

namespace locus::ouster {

namespace {

using nlohmann::json;

constexpr std::uintmax_t kMaxFileBytes = 10'000'000;
constexpr double kMPerMm = 1e-3;

/// Manufacturer's defaults for a sensor of the first generation or older.
constexpr double kLidarHeightMm = 36.18;
constexpr std::array<double, 3> kImuMm{6.253, -11.775, 7.645};

constexpr Section kSensorInfo{"sensor_info", ""}, kConfig{"config_params", ""}, kBeams{"beam_intrinsics", ""},
    kImu{"imu_intrinsics", ""}, kLidar{"lidar_intrinsics", ""}, kDataFormat{"lidar_data_format", "data_format"},
    kImuFormat{"imu_data_format", "imu_data_format"};

Eigen::Matrix4d matrix(const std::vector<double>& rows) {
  return Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>{rows.data()};
}

/// Reads a matrix in mm as a pose; empty if the key is missing.
std::optional<Pose> pose(const Document& file, const Section& section, std::string_view key) {
  constexpr double kTolerance = 1e-3; // the files have three decimals
  const auto rows = numbers(file, section, key, 16, "a matrix of 4 by 4 is needed");
  if (!rows)
    return std::nullopt;
  const Eigen::Matrix4d T = matrix(*rows);
  const Eigen::Matrix3d R = T.topLeftCorner<3, 3>();
  if (!(R * R.transpose()).isIdentity(kTolerance) || R.determinant() < 0.0 ||
      T.row(3) != Eigen::RowVector4d{0.0, 0.0, 0.0, 1.0})
    throw file.problem(section, key, "is not a rotation and a translation");
  return Pose{Eigen::Quaterniond{R}.normalized(), kMPerMm * T.topRightCorner<3, 1>()};
}

std::uint64_t serial_number(const Document& file) {
  const auto digits = text(file, kSensorInfo, "prod_sn");
  std::uint64_t number = 0;
  if (!digits || digits->empty())
    return number;
  const auto [end, error] = std::from_chars(digits->data(), digits->data() + digits->size(), number);
  if (error != std::errc{} || end != digits->data() + digits->size())
    throw file.problem(kSensorInfo, "prod_sn", "\"" + *digits + "\" is not a serial number");
  return number;
}

/// Parses for example "1024x10": columns per turn and turns per second.
void read_mode(const Document& file, Metadata& metadata) {
  const auto mode = needed(file, kConfig, "lidar_mode", text(file, kConfig, "lidar_mode"));
  const char* const end = mode.data() + mode.size();
  const auto columns = std::from_chars(mode.data(), end, metadata.columns_per_frame);
  const bool has_rate = columns.ec == std::errc{} && columns.ptr != end && *columns.ptr == 'x';
  const auto turns = std::from_chars(has_rate ? columns.ptr + 1 : end, end, metadata.frames_per_s);
  constexpr std::size_t kFewestColumns = 256, kMostColumns = 4096;
  constexpr int kMostTurns = 50;
  if (turns.ec != std::errc{} || turns.ptr != end || metadata.columns_per_frame < kFewestColumns ||
      metadata.columns_per_frame > kMostColumns || metadata.frames_per_s < 1 || metadata.frames_per_s > kMostTurns)
    throw file.problem(kConfig, "lidar_mode", "\"" + mode + "\" is no mode; one like 1024x10 is needed");
}

void read_window(const Document& file, Metadata& metadata) {
  metadata.first_column = 0;
  metadata.last_column = metadata.columns_per_frame - 1;
  const auto window = numbers(file, kDataFormat, "column_window", 2, "a first and a last column are needed");
  if (!window)
    return;
  const auto last = static_cast<double>(metadata.last_column);
  if (std::ranges::any_of(*window, [&](double id) { return id < 0.0 || id > last || id != std::floor(id); }))
    throw file.problem(kDataFormat, "column_window",
                       fmt::format("must hold columns from 0 to {}", metadata.columns_per_frame - 1));
  metadata.first_column = static_cast<std::size_t>(window->front());
  metadata.last_column = static_cast<std::size_t>(window->back());
}

void read_profile(const Document& file, Metadata& metadata) {
  if (const auto name = text(file, kDataFormat, "udp_profile_lidar")) {
    const auto profile = profile_from_string(*name);
    if (!profile)
      throw file.problem(kDataFormat, "udp_profile_lidar",
                         fmt::format("{} cannot be read; set the sensor to one of {}", *name, known_profiles()));
    metadata.profile = *profile;
  }
  metadata.safety_header =
      metadata.profile == Profile::fusa_rng15_dual || text(file, kDataFormat, "header_type") == "FUSA";
}

/// Reads the data format. Firmware before 1.14 has none: its packets have 64 pixels per column, whatever the model.
void read_data_format(const Document& file, Metadata& metadata) {
  constexpr std::size_t kMostColumns = 32;
  if (file.has(kDataFormat)) {
    constexpr std::size_t kMost = std::numeric_limits<std::uint16_t>::max();
    const auto columns =
        needed(file, kDataFormat, "columns_per_frame", count(file, kDataFormat, "columns_per_frame", 1, kMost));
    if (columns != metadata.columns_per_frame)
      throw file.problem(
          kDataFormat, "columns_per_frame",
          fmt::format("is {}, but {} says {}", columns, file.path(kConfig, "lidar_mode"), metadata.columns_per_frame));
    metadata.pixels_per_column =
        needed(file, kDataFormat, "pixels_per_column", count(file, kDataFormat, "pixels_per_column", 1, kMaxPixels));
    metadata.columns_per_packet = needed(file, kDataFormat, "columns_per_packet",
                                         count(file, kDataFormat, "columns_per_packet", 1, kMostColumns));
  }
  if (!std::has_single_bit(metadata.pixels_per_column) || metadata.pixels_per_column < FiringGroup::kLasers)
    throw file.problem(kDataFormat, "pixels_per_column", "must be 16, 32, 64 or 128");
  read_window(file, metadata);
  read_profile(file, metadata);
  const std::size_t groups =
      metadata.columns_per_packet * metadata.pixels_per_column / FiringGroup::kLasers * spec(metadata.profile).echoes;
  if (groups > LidarPacket::kMaxFiringGroups)
    throw file.problem(kDataFormat, "columns_per_packet", "makes larger packets than any Ouster sensor sends");
}

void read_angles(const Document& file, Metadata& metadata) {
  const std::size_t pixels = metadata.pixels_per_column;
  const std::string needs = fmt::format("a column has {} pixels", pixels);
  const auto read = [&](std::string_view key, std::array<double, kMaxPixels>& angles_rad) {
    const auto angles_deg = needed(file, kBeams, key, numbers(file, kBeams, key, pixels, needs));
    if (std::ranges::any_of(angles_deg, [](double angle) { return std::abs(angle) > 90.0; }))
      throw file.problem(kBeams, key, "holds an angle beyond 90 degrees");
    if (std::ranges::all_of(angles_deg, [](double angle) { return angle == 0.0; }))
      throw file.problem(kBeams, key, "holds nothing but zeros: the sensor had not started when it was asked");
    std::ranges::transform(angles_deg, angles_rad.begin(), [](double angle) { return kRadPerDeg * angle; });
  };
  read("beam_altitude_angles", metadata.altitude_rad);
  read("beam_azimuth_angles", metadata.azimuth_rad);
}

/// Returns the manufacturer's beam origin for firmware that does not report it.
double default_beam_origin_mm(std::string_view product_line) {
  if (product_line.starts_with("OS-0-"))
    return 27.67;
  if (product_line.starts_with("OS-1-"))
    return 15.806;
  return product_line.starts_with("OS-2-") ? 13.762 : 12.163;
}

void read_beam_origin(const Document& file, Metadata& metadata) {
  metadata.beam_origin_radius_m =
      kMPerMm *
      number(file, kBeams, "lidar_origin_to_beam_origin_mm").value_or(default_beam_origin_mm(metadata.product_line));
  constexpr std::string_view kKey = "beam_to_lidar_transform";
  if (const auto T_lidar_beam = pose(file, kBeams, kKey)) {
    if (!T_lidar_beam->R().isIdentity(1e-3) || T_lidar_beam->translation.y() != 0.0)
      throw file.problem(kBeams, kKey, "is more than a shift outwards and upwards");
    metadata.beam_origin_radius_m = T_lidar_beam->translation.x();
    metadata.beam_origin_height_m = T_lidar_beam->translation.z();
  }
  constexpr double kMost_m = 1.0;
  if (std::abs(metadata.beam_origin_radius_m) > kMost_m || std::abs(metadata.beam_origin_height_m) > kMost_m)
    throw file.problem(kBeams, "lidar_origin_to_beam_origin_mm", "puts the origin of the beams outside the sensor");
}

void read_mounting(const Document& file, Metadata& metadata) {
  const Pose lidar{Eigen::Quaterniond{0.0, 0.0, 0.0, 1.0}, {0.0, 0.0, kMPerMm * kLidarHeightMm}};
  const Pose imu{Eigen::Quaterniond::Identity(), kMPerMm * Eigen::Vector3d{kImuMm.data()}};
  metadata.T_sensor_lidar = pose(file, kLidar, "lidar_to_sensor_transform").value_or(lidar);
  metadata.T_sensor_imu = pose(file, kImu, "imu_to_sensor_transform").value_or(imu);
}

void read_imu_format(const Document& file, Metadata& metadata) {
  constexpr std::size_t kMostMeasurements = 64;
  const std::string profile = text(file, kDataFormat, "udp_profile_imu").value_or("LEGACY");
  metadata.standard_imu_packets = profile == "ACCEL32_GYRO32_NMEA";
  if (!metadata.standard_imu_packets && profile != "LEGACY")
    metadata.imu_port = 0;
  if (metadata.standard_imu_packets)
    metadata.imu_measurements_per_packet =
        needed(file, kImuFormat, "imu_measurements_per_packet",
               count(file, kImuFormat, "imu_measurements_per_packet", 1, kMostMeasurements));
}

void read_ports(const Document& file, Metadata& metadata) {
  constexpr std::size_t kMost = std::numeric_limits<std::uint16_t>::max();
  const auto port = [&](std::string_view key, std::uint16_t otherwise) {
    return static_cast<std::uint16_t>(count(file, kConfig, key, 0, kMost).value_or(otherwise));
  };
  metadata.lidar_port = port("udp_port_lidar", kDefaultLidarPort);
  metadata.imu_port = port("udp_port_imu", kDefaultImuPort);
}

Metadata parse(const json& root) {
  const Document file{root};
  Metadata metadata;
  metadata.product_line = text(file, kSensorInfo, "prod_line").value_or("");
  metadata.serial_number = serial_number(file);
  constexpr std::size_t kMostInitId = 0xFFFFFF;
  metadata.init_id =
      static_cast<std::uint32_t>(count(file, kSensorInfo, "initialization_id", 0, kMostInitId).value_or(0));
  read_mode(file, metadata);
  read_data_format(file, metadata);
  read_angles(file, metadata);
  read_beam_origin(file, metadata);
  read_mounting(file, metadata);
  read_ports(file, metadata);
  read_imu_format(file, metadata);
  if (const auto mode = text(file, kConfig, "timestamp_mode"))
    metadata.timestamp_mode = from_string<TimestampMode>(*mode).value_or(TimestampMode::unknown);
  return metadata;
}

} // namespace

std::string_view name_of(const Metadata& metadata) {
  struct Product {
    std::string_view line, name;
  };
  // Longer names first, since each starts with a shorter one.
  static constexpr auto kProducts = std::to_array<Product>({
      {"OS-0-128", "OS0-128"},
      {"OS-0-64", "OS0-64"},
      {"OS-0-32", "OS0-32"},
      {"OS-0-16", "OS0-16"},
      {"OS-1-128", "OS1-128"},
      {"OS-1-64", "OS1-64"},
      {"OS-1-32", "OS1-32"},
      {"OS-1-16", "OS1-16"},
      {"OS-2-128", "OS2-128"},
      {"OS-2-64", "OS2-64"},
      {"OS-2-32", "OS2-32"},
      {"OS-DOME-128", "OSDome-128"},
      {"OS-DOME-64", "OSDome-64"},
      {"OS-DOME-32", "OSDome-32"},
      {"OS-0", "OS0"},
      {"OS-1", "OS1"},
      {"OS-2", "OS2"},
      {"OS-DOME", "OSDome"},
  });
  const auto* const found = std::ranges::find_if(
      kProducts, [&](const Product& product) { return metadata.product_line.starts_with(product.line); });
  return found == kProducts.end() ? "Ouster" : found->name;
}

Expected<Metadata, std::string> parse_metadata(std::string_view text) {
  try {
    return parse(json::parse(text));
  } catch (const Problem& problem) {
    return problem.key.empty() ? problem.what : problem.key + ": " + problem.what;
  } catch (const json::parse_error& error) {
    return fmt::format("is no JSON from byte {} on", error.byte);
  } catch (const json::exception& error) {
    return std::string{error.what()};
  }
}

Expected<Metadata, std::string> read_metadata(const std::filesystem::path& file) {
  if (file.empty())
    return std::string{"names no file; an Ouster is not read without its metadata, which "
                       "`locusctl fetch SENSOR -o FILE` fetches"};
  std::error_code error;
  const std::uintmax_t bytes = std::filesystem::file_size(file, error);
  std::ifstream stream{file, std::ios::binary};
  if (error || !stream)
    return file.string() + ": cannot be read; give the metadata of the sensor, which " +
           "`locusctl fetch SENSOR -o FILE` fetches";
  if (bytes > kMaxFileBytes)
    return file.string() + ": is too large for the metadata of a sensor";
  std::string text(bytes, '\0');
  stream.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(stream.gcount()));
  auto metadata = parse_metadata(text);
  return metadata ? metadata : Expected<Metadata, std::string>{file.string() + ": " + metadata.error()};
}

} // namespace locus::ouster
