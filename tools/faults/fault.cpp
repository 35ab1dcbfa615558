// SPDX-License-Identifier: Apache-2.0
#include "faults/fault.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

#include <fmt/format.h>

namespace locus {
namespace {

/// Static properties of a kind of fault.
struct KindTraits {
  FaultKind kind;
  std::string_view name;
  bool fits_lidar;
  bool fits_position_packets;
  bool fits_odometry;
  bool fits_imu;
  std::string_view unit; ///< of VALUE; empty for a kind without one
  double default_value;
  double min_value; ///< exclusive
  double max_value; ///< inclusive
};

/// Bound on delays and clock offsets: larger ones test nothing more. That of `late` also limits the data that an
/// injector holds back.
constexpr double kMaxDelay_s = 10.0;
constexpr double kMaxClockStep_s = 1e8;
constexpr double kMaxJump = 1e6;
constexpr double kMaxScale = 1e12;

constexpr std::array kKinds{
    KindTraits{FaultKind::lost, "lost", true, true, true, true, "", 0, 0, 0},
    KindTraits{FaultKind::frozen, "frozen", true, true, true, true, "", 0, 0, 0},
    KindTraits{FaultKind::jump, "jump", true, false, true, true, "metres or rad/s", 2, -kMaxJump, kMaxJump},
    KindTraits{FaultKind::nan, "nan", false, false, true, true, "", 0, 0, 0},
    KindTraits{FaultKind::late, "late", true, true, true, true, "seconds", 0.2, 0, kMaxDelay_s},
    KindTraits{FaultKind::covariance, "covariance", false, false, true, false, "times", 10, 0, kMaxScale},
    KindTraits{FaultKind::clock_step, "clock-step", true, true, true, true, "seconds", 60, -kMaxClockStep_s,
               kMaxClockStep_s},
    KindTraits{FaultKind::packet_loss, "packet-loss", true, true, true, true, "percent", 10, 0, 100},
    KindTraits{FaultKind::reorder, "reorder", true, true, true, true, "percent", 10, 0, 100},
    KindTraits{FaultKind::duplicate, "duplicate", true, true, true, true, "percent", 10, 0, 100},
    KindTraits{FaultKind::view, "view", true, false, false, false, "degrees", 180, 0, 360},
    KindTraits{FaultKind::corrupt, "corrupt", true, true, true, true, "percent", 10, 0, 100},
};

const KindTraits& traits_of(FaultKind kind) { return *std::ranges::find(kKinds, kind, &KindTraits::kind); }

std::string joined(std::span<const std::string> words) { return fmt::format("{}", fmt::join(words, ", ")); }

/// Lists the kinds that satisfy `fits`, as users write them.
template <class Fits> std::string kinds_that(Fits&& fits) {
  std::vector<std::string> names;
  for (const KindTraits& traits : kKinds) {
    if (fits(traits)) {
      names.emplace_back(traits.name);
    }
  }
  return joined(names);
}

bool fits(const KindTraits& traits, FaultTarget::Kind target) {
  switch (target) {
  case FaultTarget::Kind::lidar:
    return traits.fits_lidar;
  case FaultTarget::Kind::position_packets:
    return traits.fits_position_packets;
  case FaultTarget::Kind::odometry:
    return traits.fits_odometry;
  case FaultTarget::Kind::imu:
    return traits.fits_imu;
  }
  return false;
}

std::string_view description(FaultTarget::Kind target) {
  switch (target) {
  case FaultTarget::Kind::lidar:
    return "a lidar";
  case FaultTarget::Kind::position_packets:
    return "a position packet";
  case FaultTarget::Kind::odometry:
    return "an odometry source";
  case FaultTarget::Kind::imu:
    return "an IMU";
  }
  return "";
}

/// Parses a finite number at the front of `text` and removes it.
std::optional<double> pop_number(std::string_view& text) {
  double number = 0.0;
  const auto [stop, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc{} || !std::isfinite(number)) {
    return std::nullopt;
  }
  text.remove_prefix(static_cast<std::size_t>(stop - text.data()));
  return number;
}

std::optional<double> parse_value(const KindTraits& traits, std::string_view text) {
  const std::optional<double> value = pop_number(text);
  const bool acceptable = value && text.empty() && *value > traits.min_value && *value <= traits.max_value;
  return acceptable ? value : std::nullopt;
}

/// Parses `T[-T1]` into the fault.
bool parse_window(std::string_view text, Fault& fault) {
  constexpr double kMax_s = 1e9;
  const std::optional<double> from = pop_number(text);
  if (!from || *from < 0.0 || *from > kMax_s) {
    return false;
  }
  fault.from = from_seconds(*from);
  if (text.empty()) {
    return true;
  }
  if (!text.starts_with('-')) {
    return false;
  }
  text.remove_prefix(1);
  const std::optional<double> until = pop_number(text);
  if (!until || !text.empty() || *until <= *from || *until > kMax_s) {
    return false;
  }
  fault.until = from_seconds(*until);
  return true;
}

} // namespace

bool Fault::strikes_lidar(std::string_view lidar) const {
  return name == kAllLidars || name == lidar ||
         (lidar.starts_with(name) &&
          (lidar.substr(name.size()) == kPositionPackets || lidar.substr(name.size()) == kInertialUnit));
}

std::string_view to_string(FaultKind kind) { return traits_of(kind).name; }

Expected<Fault, std::string> Fault::parse(std::string_view text) {
  const std::size_t colon = text.find(':');
  const std::size_t at = text.rfind('@');
  if (colon == 0 || colon == std::string_view::npos || at == std::string_view::npos || at < colon) {
    return fmt::format("fault \"{}\": expected NAME:KIND[=VALUE]@T[-T1], for example front:lost@10-20", text);
  }
  const std::string_view what = text.substr(colon + 1, at - colon - 1);
  const std::size_t equals = std::min(what.find('='), what.size());
  const auto* const traits = std::ranges::find(kKinds, what.substr(0, equals), &KindTraits::name);
  if (traits == kKinds.end()) {
    return fmt::format(R"(fault "{}": unknown kind "{}"; known are {})", text, what.substr(0, equals),
                       kinds_that([](const KindTraits&) { return true; }));
  }
  Fault fault;
  fault.name = text.substr(0, colon);
  fault.kind = traits->kind;
  fault.value = traits->default_value;
  if (equals < what.size()) {
    if (traits->unit.empty()) {
      return fmt::format(R"(fault "{}": {} takes no value; leave "{}" out)", text, traits->name, what.substr(equals));
    }
    const std::optional<double> value = parse_value(*traits, what.substr(equals + 1));
    if (!value) {
      return fmt::format("fault \"{}\": the value of {} is a number of {} above {} and up to {}", text, traits->name,
                         traits->unit, traits->min_value, traits->max_value);
    }
    fault.value = *value;
  }
  if (!parse_window(text.substr(at + 1), fault)) {
    return fmt::format("fault \"{}\": after @ expected T or T-T1, seconds from the start of the capture, T1 after T",
                       text);
  }
  return fault;
}

std::optional<std::string> fault_problem(const Fault& fault, std::span<const FaultTarget> targets) {
  const KindTraits& traits = traits_of(fault.kind);
  std::vector<std::string> names;
  bool found = false;
  for (const FaultTarget& target : targets) {
    names.push_back(target.name);
    const bool meant =
        target.name == fault.name || (fault.name == Fault::kAllLidars && target.kind == FaultTarget::Kind::lidar);
    if (meant && !fits(traits, target.kind)) {
      return fmt::format("fault \"{}:{}\": {} cannot have it; it can have {}", fault.name, traits.name,
                         description(target.kind),
                         kinds_that([&](const KindTraits& other) { return fits(other, target.kind); }));
    }
    found = found || meant;
  }
  if (found) {
    return std::nullopt;
  }
  names.emplace_back(Fault::kAllLidars);
  return fmt::format("fault \"{}:{}\": no such lidar or source; there are {}", fault.name, traits.name, joined(names));
}

FaultPlan::FaultPlan(std::span<const Fault> faults, Stamp capture_start, std::uint64_t seed)
    : capture_start_(capture_start) {
  for (const Fault& fault : faults) {
    entries_.push_back({fault, std::mt19937_64{seed + entries_.size()}});
  }
}

FaultPlan::Verdict FaultPlan::judge(std::string_view sensor, bool is_lidar, Stamp arrival) {
  const Duration since_start = arrival - capture_start_;
  Verdict verdict;
  for (Entry& entry : entries_) {
    const Fault& fault = entry.fault;
    const bool meant = is_lidar ? fault.strikes_lidar(sensor) : fault.name == sensor;
    const bool of_columns_alone = fault.name != sensor && sensor.ends_with(Fault::kInertialUnit) &&
                                  (fault.kind == FaultKind::jump || fault.kind == FaultKind::clock_step);
    const bool begun = fault.from == Duration::zero() || since_start >= fault.from;
    if (!meant || of_columns_alone || !begun || since_start >= fault.until) {
      continue;
    }
    const auto drawn = [&] { return static_cast<double>(entry.random() >> 11) * 0x1p-53 * 100.0 < fault.value; };
    switch (fault.kind) {
    case FaultKind::lost:
      verdict.lost = true;
      break;
    case FaultKind::frozen:
      verdict.frozen = true;
      break;
    case FaultKind::jump:
      verdict.jump += fault.value;
      break;
    case FaultKind::nan:
      verdict.nan = true;
      break;
    case FaultKind::late:
      verdict.delay += from_seconds(fault.value);
      break;
    case FaultKind::covariance:
      verdict.covariance_scale *= fault.value;
      break;
    case FaultKind::clock_step:
      verdict.clock_step += from_seconds(fault.value);
      break;
    case FaultKind::packet_loss:
      verdict.lost |= drawn();
      break;
    case FaultKind::reorder:
      verdict.overtaken |= drawn();
      break;
    case FaultKind::duplicate:
      verdict.duplicated |= drawn();
      break;
    case FaultKind::view:
      verdict.view_deg = std::min(verdict.view_deg, fault.value);
      break;
    case FaultKind::corrupt:
      if (drawn()) {
        verdict.corruption = entry.random();
      }
      break;
    }
  }
  return verdict;
}

} // namespace locus
