// SPDX-License-Identifier: Apache-2.0
#include "locusctl/status_text.hpp"

#include <array>
#include <cmath>
#include <cstdint>
#include <string_view>

#include <fmt/format.h>

#include "core/base/pose.hpp"

namespace locus::tools {
namespace {

using Json = nlohmann::ordered_json;

std::uint64_t sum(const Json& counters) {
  std::uint64_t total = 0;
  for (const auto& [name, value] : counters.items())
    total += value.get<std::uint64_t>();
  return total;
}

std::string bar(double share) {
  constexpr int kLength = 6;
  std::string text(kLength, '.');
  for (int i = 0; i < kLength && i < std::lround(share * 2 * kLength); ++i)
    text[static_cast<std::size_t>(i)] = '#';
  return text;
}

std::string pose_text(const Json& status) {
  if (!status.contains("pose"))
    return "pose        none yet\n";
  const auto p = status["pose"]["xyz_m"].get<std::array<double, 3>>();
  const auto a = status["pose"]["rpy_deg"].get<std::array<double, 3>>();
  const auto sigma = [&](std::size_t axis, double unit) {
    const double value = unit * std::sqrt(std::max(0.0, status["covariance"][7 * axis].get<double>()));
    return axis < 3 ? value : std::min(value, 180.0);
  };
  std::string text = fmt::format("position    {:9.3f} {:9.3f} {:9.3f} m     +- {:.3f} {:.3f} {:.3f}\n"
                                 "attitude    {:9.2f} {:9.2f} {:9.2f} deg   +- {:.2f} {:.2f} {:.2f}\n",
                                 p[0], p[1], p[2], sigma(0, 1), sigma(1, 1), sigma(2, 1), a[0], a[1], a[2],
                                 sigma(3, 1 / kRadPerDeg), sigma(4, 1 / kRadPerDeg), sigma(5, 1 / kRadPerDeg));
  static constexpr std::array<std::string_view, 6> kAxes{"x", "y", "z", "roll", "pitch", "yaw"};
  text += "lidar sees ";
  for (std::size_t i = 0; i < kAxes.size(); ++i)
    text += fmt::format(" {} {}", kAxes[i], bar(status["observability"][i].get<double>()));
  return text + '\n';
}

/// "sender 12, time 3": what was not taken, and why.
std::string reasons(const Json& counters) {
  std::string text;
  for (const auto& [name, value] : counters.items())
    if (value.get<std::uint64_t>() > 0)
      text += fmt::format("{}{} {}", text.empty() ? "" : ", ", name, value.get<std::uint64_t>());
  return text;
}

std::string silence_text(const Json& heard_ms_ago) {
  if (heard_ms_ago.is_null())
    return "always";
  const double heard_s_ago = 1e-3 * heard_ms_ago.get<double>();
  return heard_s_ago < 1000 ? fmt::format("{:.1f} s", heard_s_ago) : fmt::format("{:.1f} h", heard_s_ago / 3600);
}

std::string lidars_text(const Json& status) {
  std::string text = fmt::format("\n{:<9}{:<12}{:>5}{:>10}{:>8}{:>9}{:>9}{:>8} {}\n", "lidar", "model", "rpm",
                                 "packets", "lost", "refused", "disorder", "silent", "pps");
  for (const auto& [name, lidar] : status["lidars"].items()) {
    const Json& packets = status["packets"][name];
    text += fmt::format("{:<9.8}{:<12}{:>5.0f}{:>10}{:>8}{:>9}{:>9}{:>8} {:.8}\n", name,
                        lidar["model"].is_string() ? lidar["model"].get<std::string>() : "unheard",
                        lidar["rpm"].get<double>(), packets["data"].get<std::uint64_t>(),
                        packets["lost"].get<std::uint64_t>(), sum(packets["rejected"]),
                        packets["reordered"].get<std::uint64_t>(), silence_text(lidar["heard_ms_ago"]),
                        lidar["pps"].get<std::string>());
    if (const std::string refused = reasons(packets["rejected"]); !refused.empty())
      text += fmt::format(
          "{:<9}refused: {}{}\n", "", refused,
          lidar["refused_ip"].is_string() ? "; the last sender: " + lidar["refused_ip"].get<std::string>() : "");
    if (const std::string problem = lidar["problem"]; !problem.empty())
      text += fmt::format("{:<9}{}\n", "", problem);
  }
  return text;
}

std::string sources_text(const Json& status) {
  if (status["sources"].empty())
    return "";
  std::string text = fmt::format("\n{:<12}{:<12}{:>12}{:>12}{:>12}{:>10}{:>9}\n", "source", "health", "samples",
                                 "refused", "for sweeps", "changes", "silent");
  for (const auto& [name, source] : status["sources"].items()) {
    text += fmt::format("{:<12.11}{:<12}{:>12}{:>12}{:>12}{:>10}{:>9}\n", name, source["health"].get<std::string>(),
                        source["received"].get<std::uint64_t>(), sum(source["rejected"]),
                        source["used_sweeps"].get<std::uint64_t>(), source["health_changes"].get<std::uint64_t>(),
                        silence_text(source["heard_ms_ago"]));
    if (const std::string refused = reasons(source["rejected"]); !refused.empty())
      text += fmt::format("{:<12}refused: {}\n", "", refused);
    if (const std::string verdict = source["verdict"]; !verdict.empty())
      text += fmt::format("{:<12}{}\n", "", verdict);
  }
  return text;
}

std::string recording_text(const Json& status) {
  if (!status.contains("recording"))
    return "";
  const Json& recording = status["recording"];
  const std::string problem = recording["problem"], run = recording["run"];
  return fmt::format("recording   {}, {:.0f} MB   {} inputs   {} left out\n",
                     !problem.empty() ? "none: " + problem
                     : run.empty()    ? "nothing yet"
                                      : run,
                     recording["mb"].get<double>(), recording["recorded"].get<std::uint64_t>(),
                     recording["dropped"].get<std::uint64_t>());
}

} // namespace

std::string status_text(const Json& status) {
  const Json& sweeps = status["sweeps"];
  const Json& wall = status["process_ms"];
  const double up_s = status["duration_s"].get<double>();
  std::string text =
      fmt::format("locusd {}   {}   up {:.0f} s   flat ground {}\n", status["version"].get<std::string>(),
                  status["state"].get<std::string>(), up_s, status["flat_ground"].get<std::string>());
  text +=
      fmt::format("rate        {:.1f} Hz   last {}\n", status["rate_hz"].get<double>(),
                  status.contains("age_ms") ? fmt::format("{:.0f} ms ago", status["age_ms"].get<double>()) : "never");
  text += fmt::format("a sweep     {:.2f} ms   90 % {:.2f}   99 % {:.2f}   worst {:.2f}\n", wall["p50"].get<double>(),
                      wall["p90"].get<double>(), wall["p99"].get<double>(), wall["max"].get<double>());
  text += fmt::format("sweeps      {} seen   {} processed   {} dropped   {} failed   {} lost by kernel\n",
                      sweeps["seen"].get<std::uint64_t>(), sweeps["processed"].get<std::uint64_t>(),
                      sweeps["dropped"].get<std::uint64_t>(), sweeps["failed"].get<std::uint64_t>(),
                      status["packets"]["kernel_drops"].get<std::uint64_t>());
  if (const auto flood = status["dropped"]["flood_datagrams"].get<std::uint64_t>(); flood > 0)
    text += fmt::format("flood       {} datagrams of no lidar were kept out by the kernel\n", flood);
  text += fmt::format("machine     {:.1f} % of a core since the start   {:.0f} MB at most\n",
                      up_s > 0 ? 100 * status["cpu_s"].get<double>() / up_s : 0.0, status["peak_rss_mb"].get<double>());
  text += fmt::format("dds         {}, domain {}, interface {}\n",
                      status["dds"]["connected"].get<bool>() ? "up" : "not up, is tried again",
                      status["dds"]["domain"].get<int>(), status["dds"]["interface"].get<std::string>());
  text += recording_text(status);
  return text + pose_text(status) + lidars_text(status) + sources_text(status);
}

} // namespace locus::tools
