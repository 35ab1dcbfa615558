// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/base/expected.hpp"
#include "drivers/files/capture.hpp"

namespace locus {

/// Plays several captures in sequence: the pieces of one recording. A piece that cannot be opened, because power was
/// lost when it was started, is skipped with a warning. Single owner, not thread-safe.
class CaptureSequence : public DatagramSource {
 public:
  using Opener = std::function<Expected<Capture, std::string>(const std::filesystem::path&)>;

  /// Opens the first readable file; requires at least one file. Fails with one line for the user, from `opener`, if
  /// none can be opened.
  static Expected<CaptureSequence, std::string> open(
      std::vector<std::filesystem::path> files,
      Opener opener = [](const std::filesystem::path& file) { return Capture::open(file); });

  const Datagram* next() override;
  [[nodiscard]] std::uint64_t datagrams() const override { return before_ + capture_->datagrams(); }
  [[nodiscard]] std::string why_none() const override { return capture_->why_none(); }
  [[nodiscard]] std::vector<std::string> warnings() const override;
  [[nodiscard]] double progress() const override;

 private:
  CaptureSequence(std::vector<std::filesystem::path> files, Opener opener)
      : files_(std::move(files)), opener_(std::move(opener)) {}
  bool open_next();

  std::vector<std::filesystem::path> files_;
  Opener opener_;
  std::size_t next_file_ = 0;
  std::optional<Capture> capture_;    ///< capture of the file before next_file_
  std::uint64_t before_ = 0;          ///< datagrams of the previous captures
  std::vector<std::string> warnings_; ///< warnings of the previous captures and of files that could not be opened
};

} // namespace locus
