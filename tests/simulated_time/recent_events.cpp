// SPDX-License-Identifier: Apache-2.0
#include "simulated_time/recent_events.hpp"

#include <algorithm>
#include <cctype>

#include <fmt/format.h>

namespace locus::test {
namespace {

constexpr Duration kSettles = std::chrono::seconds{15}; ///< after an overload of this machine
constexpr int kMostOfAKind = 3;                         ///< findings reported

/// Returns the key by which findings of one kind are grouped.
std::string without_numbers(std::string text) {
  std::erase_if(text, [](unsigned char c) { return std::isdigit(c) != 0; });
  return text;
}

} // namespace

void Events::set_now(Duration now) {
  if (is_disturbed())
    disturbed_ += now - now_;
  now_ = now;
}

void Events::begin(DayFault kind) { kinds_[static_cast<std::size_t>(kind)].active = true; }

void Events::end(DayFault kind) { kinds_[static_cast<std::size_t>(kind)] = {false, now_}; }

Duration Events::since_end(DayFault kind) const { return of(kind).active ? Duration{} : now_ - of(kind).ended; }

bool Events::any(std::initializer_list<DayFault> kinds, Duration within) const {
  return std::ranges::any_of(kinds, [&](DayFault kind) { return since_end(kind) <= within; });
}

void Events::disturb(const std::string& why) {
  if (!is_disturbed())
    fmt::print("{:9.2f} s: this machine is too slow: {}\n", to_seconds(now_), why);
  disturbed_until_ = now_ + kSettles;
}

void Events::find(const std::string& what) {
  if (is_disturbed() || ++found_[without_numbers(what)] > kMostOfAKind)
    return;
  findings_.push_back(fmt::format("{:9.2f} s: {}", to_seconds(now_), what));
  fmt::print("FOUND {}\n", findings_.back());
}

} // namespace locus::test
