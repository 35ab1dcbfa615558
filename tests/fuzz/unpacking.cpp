// SPDX-License-Identifier: Apache-2.0
// Compressed files in pieces; the first byte is the length of a piece.
#include <algorithm>
#include <vector>

#include "fuzz/fuzz_bytes.hpp"
#include "unpacking/unpacking_stream.hpp"

namespace {

class Pieces : public locus::ByteStream {
 public:
  Pieces(std::span<const std::byte> bytes, std::size_t length) : left_(bytes), length_(length) {}
  std::size_t read(std::span<std::byte> out) override {
    const std::size_t count = std::min({out.size(), length_, left_.size()});
    std::ranges::copy(left_.first(count), out.begin());
    left_ = left_.subspan(count);
    return count;
  }
  [[nodiscard]] std::string problem() const override { return ""; }
  [[nodiscard]] double progress() const override { return 0; }

 private:
  std::span<const std::byte> left_;
  std::size_t length_;
};

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace locus;
  fuzz::FuzzBytes bytes(data, size);
  const std::size_t length = bytes.take<std::uint8_t>() + 1U;
  const auto stream = tools::unpacked(std::make_unique<Pieces>(bytes.rest(), length));
  std::vector<std::byte> out(100 * length);
  std::size_t steps = 0;
  while (stream->read(out) > 0)
    fuzz::demand(++steps < 1'000'000);
  fuzz::demand(stream->read(out) == 0);
  static_cast<void>(stream->problem());
  return 0;
}
