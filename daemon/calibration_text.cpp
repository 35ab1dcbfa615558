// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <ctime>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "daemon/calibration.hpp"
#include "daemon/learned_figures.hpp"

namespace locus::daemon {

using nlohmann::ordered_json;

namespace {

std::string mounting_yaml(const char* key, const ordered_json& learned, const ordered_json& better) {
  const ordered_json& T = better.at(key);
  return fmt::format("    {}: {{xyz_m: [{}], rpy_deg: [{}]}} # sd {:.2g} degrees about x, y, z of base\n", key,
                     fmt::join(T["xyz_m"].get<std::vector<double>>(), ", "),
                     fmt::join(T["rpy_deg"].get<std::vector<double>>(), ", "),
                     fmt::join(learned.at("mounting_deg").at("sd").get<std::vector<double>>(), ", "));
}

/// Formats the configuration entry of a source, with the keys in `better`.
std::string entry_yaml(const std::string& name, const ordered_json& learned, const ordered_json& better) {
  std::string yaml =
      fmt::format("  - name: {}\n    kind: {}\n", name, learned.contains("mounting_deg") ? "imu" : "odometry");
  for (const char* const key : {"late_ms", "scale", "yaw_scale"})
    if (better.contains(key))
      yaml += fmt::format("    {}: {} # sd {:.3g}\n", key, better[key].get<double>(),
                          learned.at(key).at("sd").get<double>());
  if (better.contains("T_base_source"))
    yaml += mounting_yaml("T_base_source", learned, better);
  return yaml;
}

std::string text_of(double value, double sd) { return fmt::format("{:.4g} +- {:.2g}", value, sd); }

/// Formats a line of the table for the figure `json`, or for one axis of it.
std::string line_of(std::string_view source, std::string_view figure, const ordered_json& json, bool too_late,
                    int axis = -1) {
  const auto get = [&](const char* key) {
    const ordered_json& value = json.at(key);
    return (axis < 0 ? value : value.at(static_cast<std::size_t>(axis))).get<double>();
  };
  const double sd = get("sd"), off = std::abs(get("value") - get("configured"));
  const std::string_view verdict = too_late ? "too late to calibrate during a drive"
                                   : sd >= kObservedRatio * get("configured_sd") ? "not observed by the drives so far"
                                   : off > kMinDeviation_sigma * sd              ? "better known than configured"
                                                                                 : "as configured";
  return fmt::format("{:<12} {:<24} {:>16} {:>20}  {}\n", source, figure,
                     text_of(get("configured"), get("configured_sd")), text_of(get("value"), sd), verdict);
}

/// Formats the lines of the table for a source or a lidar.
std::string lines_of(const std::string& name, const ordered_json& learned) {
  std::string text;
  const bool too_late = learned.value("too_late", false);
  for (const auto& [figure, json] : learned.items()) {
    if (figure == "mounting_deg")
      for (int axis = 0; axis < 3; ++axis)
        text += line_of(name, fmt::format("mounting_deg {}", kAxisNames[static_cast<std::size_t>(axis)]), json,
                        too_late, axis);
    else if (json.is_object() && json.contains("configured_sd"))
      text += line_of(name, figure, json, too_late);
  }
  return text;
}

} // namespace

std::string calibration_yaml(const ordered_json& sources, const ordered_json& lidars) {
  std::string notes, entries, lidar_entries;
  for (const auto& [name, source] : sources.items()) {
    const ordered_json learned = source.value("learned", ordered_json::object());
    if (learned.value("too_late", false))
      notes += fmt::format("# {} arrives too late for a calibration during a drive; calibrate it from a recording:\n"
                           "# locus-replay --calibrate FILE RECORDING\n",
                           name);
    if (const ordered_json better = learned.value("calibrated", ordered_json::object()); !better.empty())
      entries += entry_yaml(name, learned, better);
  }
  for (const auto& [name, lidar] : lidars.items()) {
    const ordered_json learned = lidar.value("learned", ordered_json::object());
    if (const ordered_json better = learned.value("calibrated", ordered_json::object()); !better.empty())
      lidar_entries += fmt::format("  - name: {}\n", name) + mounting_yaml("T_base_lidar", learned, better);
  }
  if (entries.empty() && lidar_entries.empty())
    return notes + "# No learned value is better known than the configured one.\n";
  return notes + "# For the entries of the same name.\n" + (lidar_entries.empty() ? "" : "lidars:\n" + lidar_entries) +
         (entries.empty() ? "" : "motion_sources:\n" + entries);
}

std::string calibration_text(const ordered_json& sources, const ordered_json& lidars) {
  std::string text = fmt::format("{:<12} {:<24} {:>16} {:>20}\n", "source", "figure", "configured", "learned");
  const std::size_t head = text.size();
  for (const auto& [name, source] : sources.items()) {
    if (!source.contains("learned"))
      continue;
    const ordered_json& learned = source["learned"];
    text += lines_of(name, learned);
    const auto since_s = static_cast<std::time_t>(learned.value("since_ns", std::int64_t{0}) / 1'000'000'000);
    text += fmt::format("{:<12} since {:%F %T}\n", "", fmt::localtime(since_s));
  }
  for (const auto& [name, lidar] : lidars.items())
    if (lidar.contains("learned"))
      text += lines_of(name, lidar["learned"]);
  return text.size() > head ? text : "No motion source that calibrates itself has been received.\n";
}

} // namespace locus::daemon
