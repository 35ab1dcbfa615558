// SPDX-License-Identifier: Apache-2.0
#include "unpacking/unpacking_stream.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <lzma.h>
#include <zlib.h>
#include <zstd.h>

namespace locus::tools {
namespace {

constexpr std::uint64_t kMaxMemory = 1U << 28U;
constexpr std::string_view kGzip = "\x1F\x8B", kXz = "\xFD\x37zXZ", kZstd = "\x28\xB5\x2F\xFD";
constexpr const char* kTooMuchMemory = "takes more than 256 MB of memory to unpack";

using Input = std::span<const std::byte>;
using Output = std::span<std::byte>;

/// Decompressor of one format. One owner.
class Unpacker {
 public:
  enum class State { within, between, over, damaged }; ///< between: two concatenated files; over: no more may follow

  virtual ~Unpacker() = default;
  [[nodiscard]] virtual std::string_view name() const = 0;
  /// Consumes the front of `in` and fills the front of `out`; both then are the remainder. `last`: no input follows.
  virtual State step(Input& in, Output& out, bool last) = 0;
  /// Returns the library's reason for State::damaged.
  [[nodiscard]] virtual std::string_view why() const = 0;
};

class GzipUnpacker : public Unpacker {
 public:
  GzipUnpacker() { inflateInit2(&stream_, 16 + MAX_WBITS); }
  ~GzipUnpacker() override { inflateEnd(&stream_); }
  GzipUnpacker(const GzipUnpacker&) = delete;
  GzipUnpacker& operator=(const GzipUnpacker&) = delete;

  [[nodiscard]] std::string_view name() const override { return "gzip"; }
  State step(Input& in, Output& out, bool) override {
    if (at_end_ && !in.empty() && in.front() != std::byte{0x1F})
      return State::over; // padding, which gzip ignores, too
    if (at_end_ && !in.empty())
      inflateReset(&stream_);
    at_end_ = at_end_ && in.empty();
    stream_.next_in = reinterpret_cast<Bytef*>(const_cast<std::byte*>(in.data())); // NOLINT: zlib does not write to it
    stream_.avail_in = static_cast<uInt>(in.size());
    stream_.next_out = reinterpret_cast<Bytef*>(out.data());
    stream_.avail_out = static_cast<uInt>(out.size());
    const int status = at_end_ ? Z_STREAM_END : inflate(&stream_, Z_NO_FLUSH);
    in = in.last(stream_.avail_in);
    out = out.last(stream_.avail_out);
    at_end_ = status == Z_STREAM_END;
    if (status != Z_OK && status != Z_STREAM_END && status != Z_BUF_ERROR) // Z_BUF_ERROR: needs more input
      return State::damaged;
    return at_end_ ? State::between : State::within;
  }
  [[nodiscard]] std::string_view why() const override {
    return stream_.msg != nullptr ? stream_.msg : "not written by gzip";
  }

 private:
  z_stream stream_{};
  bool at_end_ = false; ///< of one of the concatenated files
};

class XzUnpacker : public Unpacker {
 public:
  XzUnpacker() : status_(lzma_stream_decoder(&stream_, kMaxMemory, LZMA_CONCATENATED)) {}
  ~XzUnpacker() override { lzma_end(&stream_); }
  XzUnpacker(const XzUnpacker&) = delete;
  XzUnpacker& operator=(const XzUnpacker&) = delete;

  [[nodiscard]] std::string_view name() const override { return "xz"; }
  State step(Input& in, Output& out, bool last) override {
    stream_.next_in = reinterpret_cast<const std::uint8_t*>(in.data());
    stream_.avail_in = in.size();
    stream_.next_out = reinterpret_cast<std::uint8_t*>(out.data());
    stream_.avail_out = out.size();
    status_ = lzma_code(&stream_, last ? LZMA_FINISH : LZMA_RUN);
    in = in.last(stream_.avail_in);
    out = out.last(stream_.avail_out);
    if (status_ == LZMA_STREAM_END)
      return State::over;
    return status_ == LZMA_OK || status_ == LZMA_BUF_ERROR ? State::within : State::damaged;
  }
  [[nodiscard]] std::string_view why() const override {
    return status_ == LZMA_MEMLIMIT_ERROR ? kTooMuchMemory : "its contents or their checksum are wrong";
  }

 private:
  lzma_stream stream_ = LZMA_STREAM_INIT;
  lzma_ret status_;
};

class ZstdUnpacker : public Unpacker {
 public:
  [[nodiscard]] std::string_view name() const override { return "zstd"; }
  State step(Input& in, Output& out, bool) override {
    if (in.empty() && status_ == 0) // otherwise the next concatenated file starts
      return State::between;
    ZSTD_inBuffer source{in.data(), in.size(), 0};
    ZSTD_outBuffer target{out.data(), out.size(), 0};
    status_ = ZSTD_decompressStream(context_.get(), &target, &source);
    in = in.subspan(source.pos);
    out = out.subspan(target.pos);
    if (ZSTD_isError(status_) != 0)
      return State::damaged;
    return status_ == 0 ? State::between : State::within;
  }
  [[nodiscard]] std::string_view why() const override { // the library's default limit is 128 MB
    return ZSTD_getErrorName(status_);
  }

 private:
  std::unique_ptr<ZSTD_DCtx, decltype([](ZSTD_DCtx* context) { ZSTD_freeDCtx(context); })> context_{ZSTD_createDCtx()};
  std::size_t status_ = 0;
};

class UnpackingStream : public ByteStream {
 public:
  explicit UnpackingStream(std::unique_ptr<ByteStream> packed) : packed_(std::move(packed)), buffer_(kBufferBytes) {
    while (left_.size() < kXz.size() && !is_last_)
      refill();
    const std::string_view start(reinterpret_cast<const char*>(left_.data()), left_.size());
    if (start.starts_with(kGzip))
      unpacker_ = std::make_unique<GzipUnpacker>();
    else if (start.starts_with(kXz))
      unpacker_ = std::make_unique<XzUnpacker>();
    else if (start.starts_with(kZstd))
      unpacker_ = std::make_unique<ZstdUnpacker>();
  }

  std::size_t read(Output out) override { return unpacker_ ? unpack(out) : pass_on(out); }
  /// Returns the problem of the compressed stream first: it causes the truncation of the output.
  [[nodiscard]] std::string problem() const override {
    std::string before = packed_->problem();
    return before.empty() ? problem_ : before;
  }
  [[nodiscard]] double progress() const override { return packed_->progress(); }

 private:
  static constexpr std::size_t kBufferBytes = 1 << 16;

  /// Appends to the remainder in the buffer.
  void refill() {
    std::ranges::copy(left_, buffer_.begin());
    const std::size_t more = packed_->read(Output(buffer_).subspan(left_.size()));
    left_ = Input(buffer_).first(left_.size() + more);
    is_last_ = more == 0;
  }

  std::size_t pass_on(Output out) {
    if (left_.empty())
      return packed_->read(out);
    const std::size_t count = std::min(out.size(), left_.size());
    std::ranges::copy(left_.first(count), out.begin());
    left_ = left_.subspan(count);
    return count;
  }

  std::size_t unpack(Output out) {
    Output room = out;
    while (!is_over_ && room.size() == out.size()) {
      if (left_.empty() && !is_last_)
        refill();
      const std::size_t before = left_.size();
      const Unpacker::State state = unpacker_->step(left_, room, is_last_);
      const bool stands_still = left_.size() == before && room.size() == out.size();
      is_over_ = state == Unpacker::State::over || state == Unpacker::State::damaged || (is_last_ && stands_still);
      if (state == Unpacker::State::damaged)
        problem_ = fmt::format("its {} compression is damaged ({})", unpacker_->name(), unpacker_->why());
      else if (is_over_ && state == Unpacker::State::within)
        problem_ = fmt::format("its {} compression is truncated", unpacker_->name());
    }
    return out.size() - room.size();
  }

  std::unique_ptr<ByteStream> packed_;
  std::vector<std::byte> buffer_;
  Input left_;           ///< unread part of buffer_
  bool is_last_ = false; ///< no input follows left_
  bool is_over_ = false;
  std::unique_ptr<Unpacker> unpacker_; ///< nullptr if the stream is not compressed
  std::string problem_;
};

} // namespace

std::unique_ptr<ByteStream> unpacked(std::unique_ptr<ByteStream> packed) {
  return std::make_unique<UnpackingStream>(std::move(packed));
}

Expected<Capture, std::string> open_capture(const std::filesystem::path& file) {
  Expected<std::unique_ptr<ByteStream>, std::string> stream = open_stream(file);
  return stream ? Capture::open(unpacked(std::move(*stream)), file) : stream.error();
}

} // namespace locus::tools
