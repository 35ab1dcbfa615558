// SPDX-License-Identifier: Apache-2.0
#include "locusctl/screen.hpp"

#include <csignal>
#include <cstdio>
#include <string>

#include <fmt/format.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include "daemon/machine_time.hpp"
#include "locus_replay/failure.hpp"

namespace locus::tools {
namespace {

volatile std::sig_atomic_t interrupted = 0;

struct Size {
  std::size_t rows = 24, columns = 80;
};

Size size_of_terminal() {
  winsize size{};
  if (ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_row == 0 || size.ws_col == 0)
    return {};
  return {size.ws_row, size.ws_col};
}

} // namespace

Screen::Screen() {
  if (isatty(STDOUT_FILENO) == 0)
    throw Failure(ExitStatus::wrong_usage, "--watch needs a terminal; use status or status --json");
  for (const int number : {SIGINT, SIGTERM, SIGHUP})
    std::signal(number, [](int) { interrupted = 1; });
  if (termios settings{}; tcgetattr(STDIN_FILENO, &settings) == 0) {
    original_settings_ = settings;
    settings.c_lflag &= ~static_cast<tcflag_t>(ICANON | ECHO);
    settings.c_cc[VSUSP] = _POSIX_VDISABLE; // disables suspending: a shell prompt would be lost on this page
    tcsetattr(STDIN_FILENO, TCSANOW, &settings);
  }
  fmt::print("\x1b[?1049h\x1b[?25l");
}

Screen::~Screen() {
  std::fputs("\x1b[?25h\x1b[?1049l", stdout);
  std::fflush(stdout);
  if (original_settings_)
    tcsetattr(STDIN_FILENO, TCSAFLUSH, &*original_settings_);
}

void Screen::show(std::string_view text) { // NOLINT(readability-convert-member-functions-to-static): on our page
  const Size size = size_of_terminal();
  std::string out = "\x1b[H";
  for (std::size_t row = 0; row < size.rows && !text.empty(); ++row) {
    const std::string_view line = text.substr(0, text.find('\n'));
    text.remove_prefix(std::min(text.size(), line.size() + 1));
    out += row > 0 ? "\n" : "";
    out += line.substr(0, size.columns);
    out += line.size() < size.columns ? "\x1b[K" : ""; // it would erase the last character of a full line
  }
  fmt::print("{}\x1b[J", out);
  std::fflush(stdout);
}

bool Screen::wait_for_end(Duration timeout) {
  pollfd keys{original_settings_ ? STDIN_FILENO : -1, POLLIN, 0};
  const Duration end = daemon::read_clock(CLOCK_MONOTONIC) + timeout;
  for (Duration now{}; interrupted == 0 && (now = daemon::read_clock(CLOCK_MONOTONIC)) < end;) {
    const timespec wait = daemon::to_timespec(end - now);
    if (ppoll(&keys, 1, &wait, nullptr) <= 0)
      continue;
    char key = 'q'; // also if the terminal is gone
    if (read(STDIN_FILENO, &key, 1) <= 0 || key == 'q')
      return true;
  }
  return interrupted != 0;
}

} // namespace locus::tools
