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

/// Captures one after the other: the pieces of one recording. One that cannot be opened, because the computer was
/// switched off when it was begun, is left out with a warning. One owner.
class CaptureSequence : public DatagramSource {
 public:
  using Opener = std::function<Expected<Capture, std::string>(const std::filesystem::path&)>;

  /// At least one file; of one that stands alone, what `opener` says. Fails with one line for the user when none of
  /// them can be opened.
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
  std::optional<Capture> capture_;    ///< of the file before next_file_
  std::uint64_t before_ = 0;          ///< datagrams of the captures before
  std::vector<std::string> warnings_; ///< of the captures before, and of those that could not be opened
};

} // namespace locus
