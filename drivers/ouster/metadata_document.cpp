// SPDX-License-Identifier: Apache-2.0
#include "drivers/ouster/metadata_document.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <fmt/format.h>

namespace locus::ouster {

namespace {

using nlohmann::json;

constexpr auto kNeededSections = std::to_array<std::string_view>(
    {"sensor_info", "beam_intrinsics", "imu_intrinsics", "lidar_intrinsics", "config_params"});
/// Sections that may be plain text: old firmware writes an error message there.
constexpr auto kNeededKeys = std::to_array<std::string_view>({"lidar_data_format", "calibration_status"});

double finite(const Document& file, const Section& section, std::string_view key, const json& value) {
  if (!value.is_number() || !std::isfinite(value.get<double>()))
    throw file.problem(section, key, "must hold finite numbers");
  return value.get<double>();
}

} // namespace

Document::Document(const json& root) : root_(root) {
  if (!root.is_object())
    throw Problem{"", "not the metadata of an Ouster sensor: no keys at all"};
  const auto is_there = [&](std::string_view name) { return root.contains(name); };
  nested_ = std::ranges::any_of(kNeededSections, is_there);
  if (!nested_ && !is_there("beam_altitude_angles"))
    throw Problem{"beam_altitude_angles", "is missing; this is not the metadata of an Ouster sensor"};
  if (!nested_ && is_there("calibration_status"))
    throw Problem{"calibration_status", "belongs to a file with sections, which this one is not"};
  if (!nested_)
    return;
  for (const std::string_view name : kNeededSections)
    if (!is_there(name) || !root.at(std::string{name}).is_object())
      throw Problem{std::string{name}, "this section is missing"};
  for (const std::string_view name : kNeededKeys)
    if (!is_there(name))
      throw Problem{std::string{name}, "this section is missing"};
}

const json* Document::find(const Section& section, std::string_view key) const {
  const json* const keys = keys_of(section);
  if (keys == nullptr)
    return nullptr;
  const auto found = keys->find(key);
  return found == keys->end() || found->is_null() ? nullptr : &*found;
}

std::string Document::path(const Section& section, std::string_view key) const {
  const std::string_view name = nested_ ? section.name : section.flat_name;
  return name.empty() ? std::string{key} : fmt::format("{}.{}", name, key);
}

Problem Document::problem(const Section& section, std::string_view key, std::string what) const {
  return {path(section, key), std::move(what)};
}

const json* Document::keys_of(const Section& section) const {
  const std::string_view name = nested_ ? section.name : section.flat_name;
  if (name.empty())
    return &root_;
  const auto found = root_.find(name);
  return found == root_.end() || !found->is_object() ? nullptr : &*found;
}

std::optional<std::string> text(const Document& file, const Section& section, std::string_view key) {
  const json* const value = file.find(section, key);
  if (value == nullptr)
    return std::nullopt;
  if (!value->is_string())
    throw file.problem(section, key, "must be text");
  return value->get<std::string>();
}

std::optional<double> number(const Document& file, const Section& section, std::string_view key) {
  const json* const value = file.find(section, key);
  return value == nullptr ? std::nullopt : std::optional{finite(file, section, key, *value)};
}

std::optional<std::size_t> count(const Document& file, const Section& section, std::string_view key, std::size_t least,
                                 std::size_t most) {
  const json* const value = file.find(section, key);
  if (value == nullptr)
    return std::nullopt;
  const double whole = finite(file, section, key, *value);
  if (whole < static_cast<double>(least) || whole > static_cast<double>(most) || whole != std::floor(whole))
    throw file.problem(section, key, fmt::format("must be a whole number from {} to {}", least, most));
  return static_cast<std::size_t>(whole);
}

std::optional<std::vector<double>> numbers(const Document& file, const Section& section, std::string_view key,
                                           std::size_t size, std::string_view what) {
  const json* const value = file.find(section, key);
  if (value == nullptr)
    return std::nullopt;
  if (!value->is_array())
    throw file.problem(section, key, "must be a list of numbers");
  if (value->size() != size)
    throw file.problem(section, key, fmt::format("holds {} numbers, but {}", value->size(), what));
  std::vector<double> result;
  for (const json& one : *value)
    result.push_back(finite(file, section, key, one));
  return result;
}

} // namespace locus::ouster
