// SPDX-License-Identifier: Apache-2.0
#include "unpacking/unpacked_copy.hpp"

#include <cerrno>
#include <cstdlib>
#include <system_error>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include "unpacking/unpacking_stream.hpp"

namespace locus::tools {
namespace {

std::string folder_for_temporary_files() {
  const char* const wanted = std::getenv("TMPDIR");
  return wanted != nullptr && *wanted != '\0' ? wanted : "/var/tmp"; // /tmp may be in memory
}

bool write_all(int descriptor, std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t count = write(descriptor, bytes.data(), bytes.size());
    if (count < 0 && errno != EINTR)
      return false;
    bytes = bytes.subspan(count < 0 ? 0 : static_cast<std::size_t>(count));
  }
  return true;
}

/// Reads what is available, but at least the bytes that identify the format; 0 at the end.
std::size_t fill(ByteStream& stream, std::span<std::byte> buffer) {
  constexpr std::size_t kStart = 60;
  std::size_t filled = 0;
  for (std::size_t more = 1; more > 0 && filled < kStart; filled += more)
    more = stream.read(buffer.subspan(filled));
  return filled;
}

} // namespace

Expected<UnpackedCopy, std::string> UnpackedCopy::make(const std::filesystem::path& packed, IsOfUse is_of_use,
                                                       std::uint64_t stays_free_bytes) {
  constexpr std::size_t kBufferBytes = 1 << 18;
  Expected<std::unique_ptr<ByteStream>, std::string> opened = open_stream(packed);
  if (!opened)
    return std::string("cannot be read; check its permissions");
  const std::unique_ptr<ByteStream> stream = unpacked(std::move(*opened));
  UnpackedCopy copy(folder_for_temporary_files());
  if (copy.descriptor_ < 0)
    return copy.why_not();
  std::vector<std::byte> buffer(kBufferBytes);
  std::size_t count = fill(*stream, buffer);
  const bool is_wanted = is_of_use({reinterpret_cast<const char*>(buffer.data()), count});
  for (; count > 0; count = is_wanted ? fill(*stream, buffer) : 0) {
    if (!copy.leaves_free(stays_free_bytes))
      return fmt::format(
          "it is compressed, and unpacking it would leave less than {} MB free in {}; free space there, or "
          "name a folder with room for it with: export TMPDIR=FOLDER",
          stays_free_bytes / 1'000'000, copy.folder_);
    if (!write_all(copy.descriptor_, std::span(buffer).first(count)))
      return copy.why_not();
  }
  copy.problem_ = stream->problem();
  return copy;
}

UnpackedCopy::UnpackedCopy(std::string folder)
    : folder_(std::move(folder)),
      descriptor_(open(folder_.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, S_IRUSR | S_IWUSR)) {
  if (descriptor_ >= 0)
    return;
  std::string name = folder_ + "/locus-unpacked-XXXXXX"; // fallback for file systems without unnamed files
  descriptor_ = mkostemp(name.data(), O_CLOEXEC);
  if (descriptor_ >= 0)
    name_ = name;
}

UnpackedCopy::UnpackedCopy(UnpackedCopy&& other) noexcept
    : folder_(std::move(other.folder_)), descriptor_(std::exchange(other.descriptor_, -1)),
      name_(std::exchange(other.name_, {})), problem_(std::move(other.problem_)) {}

UnpackedCopy::~UnpackedCopy() {
  if (!name_.empty())
    unlink(name_.c_str());
  if (descriptor_ >= 0)
    close(descriptor_);
}

std::filesystem::path UnpackedCopy::path() const { return fmt::format("/proc/self/fd/{}", descriptor_); }

Expected<std::filesystem::path, std::string> UnpackedCopy::give_name() {
  constexpr int kAttempts = 100;
  for (int i = 0; i < kAttempts && name_.empty(); ++i) {
    const std::string name = fmt::format("{}/locus-unpacked-{}-{}", folder_, getpid(), i);
    if (linkat(AT_FDCWD, path().c_str(), AT_FDCWD, name.c_str(), AT_SYMLINK_FOLLOW) == 0)
      name_ = name;
  }
  if (name_.empty())
    return why_not();
  return std::filesystem::path(name_);
}

/// Describes the last system error.
std::string UnpackedCopy::why_not() const {
  return fmt::format("it is compressed, and cannot be unpacked in {} ({}); name a folder with room for it with: export "
                     "TMPDIR=FOLDER",
                     folder_, std::generic_category().message(errno));
}

bool UnpackedCopy::leaves_free(std::uint64_t bytes) const {
  struct statvfs there {};
  return fstatvfs(descriptor_, &there) != 0 || std::uint64_t{there.f_bavail} * there.f_frsize >= bytes;
}

} // namespace locus::tools
