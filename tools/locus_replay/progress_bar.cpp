// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/progress_bar.hpp"

#include <algorithm>
#include <cstdio>
#include <ctime>
#include <string>

#include <fmt/format.h>
#include <unistd.h>

#include "daemon/machine_time.hpp"

namespace locus::tools {
namespace {

constexpr Duration kQuietFor = std::chrono::seconds{1};
constexpr Duration kInterval = std::chrono::milliseconds{200};
constexpr int kWidth = 40;

} // namespace

ProgressBar::ProgressBar(bool wanted)
    : enabled_(wanted && isatty(STDERR_FILENO) != 0), begin_(daemon::read_clock(CLOCK_MONOTONIC)),
      next_(begin_ + kQuietFor) {}

void ProgressBar::wipe() {
  if (drawn_)
    std::fputs("\r\x1b[K", stderr);
  drawn_ = false;
}

void ProgressBar::show(double done) {
  const Duration now = enabled_ ? daemon::read_clock(CLOCK_MONOTONIC) : Duration{};
  if (!enabled_ || now < next_)
    return;
  next_ = now + kInterval;
  drawn_ = true;
  done = std::clamp(done, 1e-3, 1.0);
  const auto filled = static_cast<std::size_t>(done * kWidth);
  fmt::print(stderr, "\r[{:<{}}] {:3.0f} %, {:.0f} s left ", std::string(filled, '='), kWidth, 100.0 * done,
             to_seconds(now - begin_) * (1.0 / done - 1.0));
  std::fflush(stderr);
}

} // namespace locus::tools
