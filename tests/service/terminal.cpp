// SPDX-License-Identifier: Apache-2.0
#include "service/terminal.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <chrono>
#include <csignal>
#include <stdexcept>

#include <fcntl.h>
#include <poll.h>
#include <pty.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

namespace locus::test {

Terminal::Terminal(std::vector<std::string> command) {
  std::array<char, 64> name{};
  const winsize size{kRows, kColumns, 0, 0};
  if (openpty(&master_, &slave_, name.data(), nullptr, &size) != 0)
    throw std::runtime_error("no terminal");
  for (const int end : {master_, slave_})
    fcntl(end, F_SETFD, FD_CLOEXEC);
  settings_before_ = settings();
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  for (const int standard : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) // opened by a new session: it is its terminal
    posix_spawn_file_actions_addopen(&actions, standard, name.data(), O_RDWR, 0);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSID);
  std::vector<char*> arguments;
  for (std::string& word : command)
    arguments.push_back(word.data());
  arguments.push_back(nullptr);
  const int error = posix_spawn(&pid_, arguments[0], &actions, &attributes, arguments.data(), environ);
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0)
    throw std::runtime_error("cannot start " + command.front());
}

Terminal::~Terminal() {
  if (!status_)
    kill(pid_, SIGKILL);
  wait_for_exit();
  close(slave_);
  close(master_);
}

void Terminal::type(std::string_view keys) const {
  if (write(master_, keys.data(), keys.size()) != static_cast<ssize_t>(keys.size()))
    throw std::runtime_error("the terminal takes no keys");
}

bool Terminal::wait_until(const std::function<bool()>& holds) {
  const auto give_up = std::chrono::steady_clock::now() + patience();
  while (!holds()) {
    if (std::chrono::steady_clock::now() > give_up)
      return false;
    read_some(std::chrono::milliseconds{10});
  }
  return true;
}

bool Terminal::shows(const std::string& text) {
  return wait_until([&] {
    return std::ranges::any_of(rows_, [&](const std::string& row) { return row.find(text) != std::string::npos; });
  });
}

std::optional<int> Terminal::wait_for_exit() {
  wait_until([&] {
    int status = 0;
    if (!status_ && waitpid(pid_, &status, WNOHANG) == pid_)
      status_ = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
    return status_.has_value();
  });
  read_some(std::chrono::milliseconds{10}); // remaining output
  return status_;
}

termios Terminal::settings() const {
  termios settings{};
  tcgetattr(slave_, &settings);
  return settings;
}

void Terminal::read_some(Duration timeout) {
  pollfd there{master_, POLLIN, 0};
  const auto wait_ms = std::chrono::duration_cast<std::chrono::milliseconds>(timeout).count();
  if (poll(&there, 1, static_cast<int>(wait_ms)) <= 0)
    return;
  std::array<char, 4096> text{};
  const ssize_t size = read(master_, text.data(), text.size());
  for (ssize_t i = 0; i < size; ++i)
    take(text[static_cast<std::size_t>(i)]);
}

void Terminal::take(char c) {
  if (escape_) {
    *escape_ += c;
    if (c != '[' && std::isalpha(static_cast<unsigned char>(c)) != 0) {
      obey(*escape_);
      escape_.reset();
    }
  } else if (c == '\x1b') {
    escape_.emplace();
  } else if (c == '\r') {
    column_ = 0;
  } else if (c == '\n') {
    overflows_ += row_ + 1 == kRows ? 1 : 0;
    row_ = std::min(row_ + 1, kRows - 1);
  } else if (column_ == kColumns) {
    ++overflows_;
  } else {
    rows_[row_][column_++] = c;
  }
}

void Terminal::obey(const std::string& sequence) {
  const auto wipe_row = [&](std::size_t row, std::size_t from) {
    std::fill(rows_[row].begin() + static_cast<std::ptrdiff_t>(std::min(from, kColumns - 1)), rows_[row].end(), ' ');
  };
  if (sequence == "[H") {
    row_ = column_ = 0;
    ++pages_;
  } else if (sequence == "[K") {
    wipe_row(row_, column_);
  } else if (sequence == "[J") {
    wipe_row(row_, column_);
    for (std::size_t below = row_ + 1; below < kRows; ++below)
      wipe_row(below, 0);
  } else if (sequence == "[?1049h" || sequence == "[?1049l") {
    on_page_of_its_own_ = sequence.back() == 'h';
  } else if (sequence == "[?25h" || sequence == "[?25l") {
    cursor_is_shown_ = sequence.back() == 'h';
  }
}

} // namespace locus::test
