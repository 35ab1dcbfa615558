// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "core/base/expected.hpp"

namespace locus::tools {

/// A packed file as one that can be read at any place: a temporary file in $TMPDIR, or else /var/tmp, which need not
/// fit into memory. It goes with this; whoever has opened it by then may read on. One owner.
class UnpackedCopy {
 public:
  /// Whether a file that begins with these bytes, some 60 if it has so many, is of use.
  using IsOfUse = bool (*)(std::string_view start);
  /// A machine whose disk is full does more harm than a bag that is not read: so many bytes stay free.
  static constexpr std::uint64_t kStaysFree_bytes = 1'000'000'000;

  /// Of a file that breaks off or is damaged, what lies before; of one that is of no use, its beginning. Fails with one
  /// line for the user, without the file's name.
  static Expected<UnpackedCopy, std::string> make(const std::filesystem::path& packed, IsOfUse is_of_use,
                                                  std::uint64_t stays_free_bytes = kStaysFree_bytes);

  UnpackedCopy(UnpackedCopy&& other) noexcept;
  UnpackedCopy& operator=(UnpackedCopy&&) = delete;
  UnpackedCopy(const UnpackedCopy&) = delete;
  UnpackedCopy& operator=(const UnpackedCopy&) = delete;
  ~UnpackedCopy();

  /// Where this process opens it. No other sees it, and nothing stays behind however the program ends, where the file
  /// system knows files without names.
  [[nodiscard]] std::filesystem::path path() const;
  /// For those who look up what the path leads to: one in the folder of temporary files, until this goes. Fails as
  /// make() does.
  Expected<std::filesystem::path, std::string> give_name();
  /// Why it is not whole, as ByteStream::problem().
  [[nodiscard]] const std::string& problem() const { return problem_; }

 private:
  explicit UnpackedCopy(std::string folder);
  [[nodiscard]] std::string why_not() const;
  [[nodiscard]] bool leaves_free(std::uint64_t bytes) const;

  std::string folder_;
  int descriptor_ = -1; ///< -1: another one has it
  std::string name_;    ///< empty: none
  std::string problem_;
};

} // namespace locus::tools
