// SPDX-License-Identifier: Apache-2.0
#include "drivers/files/byte_stream.hpp"

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <system_error>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

namespace locus {
namespace {

class FileStream : public ByteStream {
 public:
  FileStream(int descriptor, std::uint64_t size) : descriptor_(descriptor), size_(size) {}
  ~FileStream() override { close(descriptor_); }
  FileStream(const FileStream&) = delete;
  FileStream& operator=(const FileStream&) = delete;

  std::size_t read(std::span<std::byte> out) override {
    ssize_t count = 0;
    do
      count = ::read(descriptor_, out.data(), out.size());
    while (count < 0 && errno == EINTR);
    if (count < 0)
      problem_ = fmt::format("cannot be read to its end ({})", std::generic_category().message(errno));
    const auto filled = static_cast<std::size_t>(std::max<ssize_t>(count, 0));
    at_ += filled;
    return filled;
  }
  [[nodiscard]] std::string problem() const override { return problem_; }
  [[nodiscard]] double progress() const override {
    return size_ > 0 ? std::min(1.0, static_cast<double>(at_) / static_cast<double>(size_)) : 0.0;
  }

 private:
  int descriptor_;
  std::uint64_t size_; ///< 0 if unknown
  std::uint64_t at_ = 0;
  std::string problem_;
};

} // namespace

Expected<std::unique_ptr<ByteStream>, std::string> open_stream(const std::filesystem::path& file) {
  const int descriptor =
      file == "-" ? fcntl(STDIN_FILENO, F_DUPFD_CLOEXEC, 0) : open(file.c_str(), O_RDONLY | O_CLOEXEC);
  struct stat status {};
  if (descriptor < 0 || fstat(descriptor, &status) != 0)
    return fmt::format("{}: {}; check the path", file.string(), std::generic_category().message(errno));
  auto stream = std::make_unique<FileStream>(descriptor,
                                             S_ISREG(status.st_mode) ? static_cast<std::uint64_t>(status.st_size) : 0);
  if (S_ISDIR(status.st_mode))
    return fmt::format("{}: a folder, not a capture; name the file in it", file.string());
  return std::unique_ptr<ByteStream>(std::move(stream));
}

} // namespace locus
