// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "core/base/expected.hpp"

namespace locus::tools {

/// Compressed file made seekable: decompressed to a temporary file in $TMPDIR, or else /var/tmp, of any size. Deleted
/// with this; files opened by then stay readable. One owner.
class UnpackedCopy {
 public:
  /// Returns whether a file with these first bytes, up to about 60, is wanted.
  using IsOfUse = bool (*)(std::string_view start);
  /// Disk space to leave free: a full disk does more harm than an unread bag.
  static constexpr std::uint64_t kStaysFree_bytes = 1'000'000'000;

  /// Decompresses the file: up to the damage if it is truncated or damaged; only its beginning if it is not wanted.
  /// Fails with one line for the user, without the file's name.
  static Expected<UnpackedCopy, std::string> make(const std::filesystem::path& packed, IsOfUse is_of_use,
                                                  std::uint64_t stays_free_bytes = kStaysFree_bytes);

  UnpackedCopy(UnpackedCopy&& other) noexcept;
  UnpackedCopy& operator=(UnpackedCopy&&) = delete;
  UnpackedCopy(const UnpackedCopy&) = delete;
  UnpackedCopy& operator=(const UnpackedCopy&) = delete;
  ~UnpackedCopy();

  /// Returns the path for this process. If the file system supports unnamed files, no other process sees the file and
  /// nothing remains however the program ends.
  [[nodiscard]] std::filesystem::path path() const;
  /// Returns a name in the folder of temporary files, valid for the lifetime of this, for libraries that resolve the
  /// path. Fails as make() does.
  Expected<std::filesystem::path, std::string> give_name();
  /// Returns why it is incomplete, as ByteStream::problem().
  [[nodiscard]] const std::string& problem() const { return problem_; }

 private:
  explicit UnpackedCopy(std::string folder);
  [[nodiscard]] std::string why_not() const;
  [[nodiscard]] bool leaves_free(std::uint64_t bytes) const;

  std::string folder_;
  int descriptor_ = -1; ///< -1: moved from
  std::string name_;    ///< empty: none
  std::string problem_;
};

} // namespace locus::tools
