// SPDX-License-Identifier: Apache-2.0
#include "drivers/velodyne/calibration.hpp"

#include <bitset>
#include <cmath>
#include <stdexcept>

#include <yaml-cpp/yaml.h>

namespace locus::velodyne {

namespace {

/// Error and its position. Internal to this file.
struct Problem {
  YAML::Mark mark;
  std::string what;
};

double number(const YAML::Node& laser, const char* key, double otherwise) {
  const YAML::Node node = laser[key];
  if (!node)
    return otherwise;
  try {
    const auto value = node.as<double>();
    if (std::isfinite(value))
      return value;
  } catch (const YAML::Exception&) { // reported below, with the key
  }
  throw Problem{node.Mark(), std::string{key} + " must be a finite number"};
}

double required_number(const YAML::Node& node, const char* key) {
  if (!node[key])
    throw Problem{node.Mark(), std::string{key} + " is missing"};
  return number(node, key, 0.0);
}

std::size_t count(const YAML::Node& node, const char* key, std::size_t below) {
  const double value = required_number(node, key);
  if (value < 0.0 || value >= static_cast<double>(below) || value != std::floor(value))
    throw Problem{node[key].Mark(),
                  std::string{key} + " must be a whole number from 0 to " + std::to_string(below - 1)};
  return static_cast<std::size_t>(value);
}

/// Converts the corrections of one laser to the fields of Laser. In the driver's formulas, vert_offset_correction
/// shifts the origin of a beam across the beam, horiz_offset_correction shifts it to the left, and rot_correction
/// rotates the beam against the azimuth.
Laser read_laser(const YAML::Node& node) {
  if (const YAML::Node two_point = node["two_pt_correction_available"]; two_point && two_point.as<bool>(true))
    throw Problem{two_point.Mark(), "two-point corrections belong to an HDL-64E, which is not supported"};
  const double elevation_rad = required_number(node, "vert_correction");
  const double across_m = number(node, "vert_offset_correction", 0.0);
  return {.elevation_rad = elevation_rad,
          .azimuth_offset_rad = -number(node, "rot_correction", 0.0),
          .vertical_offset_m = across_m * std::cos(elevation_rad),
          .radial_offset_m = -across_m * std::sin(elevation_rad),
          .lateral_offset_m = number(node, "horiz_offset_correction", 0.0),
          .range_offset_m = number(node, "dist_correction", 0.0)};
}

Calibration parse(const YAML::Node& file) {
  constexpr double kOldDriversResolutionM = 0.002; // files without the key are for sensors with 2 mm
  if (!file.IsMap() || !file["lasers"] || !file["lasers"].IsSequence())
    throw Problem{file.Mark(), "no list of lasers; a calibration file of velodyne_pointcloud is expected"};
  const YAML::Node lasers = file["lasers"];

  Calibration calibration;
  calibration.laser_count = count(file, "num_lasers", kMaxLasers + 1);
  calibration.distance_resolution_m = number(file, "distance_resolution", kOldDriversResolutionM);
  if (calibration.distance_resolution_m <= 0.0)
    throw Problem{file["distance_resolution"].Mark(), "distance_resolution must be above 0"};
  if (lasers.size() != calibration.laser_count)
    throw Problem{lasers.Mark(), "num_lasers is " + std::to_string(calibration.laser_count) + ", but there are " +
                                     std::to_string(lasers.size()) + " lasers"};
  std::bitset<kMaxLasers> present;
  for (const YAML::Node& laser : lasers) {
    if (!laser.IsMap())
      throw Problem{laser.Mark(), "a laser must be a map of corrections"};
    const std::size_t id = count(laser, "laser_id", calibration.laser_count);
    if (present.test(id))
      throw Problem{laser.Mark(), "laser_id " + std::to_string(id) + " is there twice"};
    present.set(id);
    calibration.storage[id] = read_laser(laser);
  }
  calibration.assign_rings();
  return calibration;
}

std::string message(const std::filesystem::path& file, const YAML::Mark& mark, const std::string& what) {
  return file.string() + ":" + std::to_string(mark.is_null() ? 1 : mark.line + 1) + ": " + what;
}

} // namespace

Expected<Calibration, std::string> read_calibration(const std::filesystem::path& file) {
  try {
    return parse(YAML::LoadFile(file.string()));
  } catch (const Problem& problem) {
    return message(file, problem.mark, problem.what);
  } catch (const YAML::BadFile&) {
    return file.string() +
           ": cannot be read; give a file of velodyne_pointcloud, or leave the key empty for the model's own table";
  } catch (const YAML::Exception& exception) {
    return message(file, exception.mark, exception.msg);
  }
}

} // namespace locus::velodyne
