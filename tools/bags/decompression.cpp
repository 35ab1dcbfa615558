// SPDX-License-Identifier: Apache-2.0
#include "bags/decompression.hpp"

#include <memory>
#include <vector>

#include <bzlib.h>
#include <lz4frame.h>
#include <zstd.h>

namespace locus::tools {

bool decompress_bzip2(std::span<const std::byte> in, std::span<std::byte> out) {
  const auto* begin = reinterpret_cast<const char*>(in.data());
  std::vector<char> source(begin, begin + in.size()); // bzip2's API is not const-correct
  auto size = static_cast<unsigned>(out.size());
  return BZ2_bzBuffToBuffDecompress(reinterpret_cast<char*>(out.data()), &size, source.data(),
                                    static_cast<unsigned>(source.size()), 0, 0) == BZ_OK &&
         size == out.size();
}

bool decompress_lz4(std::span<const std::byte> in, std::span<std::byte> out) {
  LZ4F_dctx* made = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&made, LZ4F_VERSION)) != 0)
    return false;
  const std::unique_ptr<LZ4F_dctx, decltype([](LZ4F_dctx* c) { LZ4F_freeDecompressionContext(c); })> context(made);
  std::size_t hint = 1;
  while (hint != 0 && !in.empty()) {
    std::size_t read = in.size(), written = out.size();
    hint = LZ4F_decompress(context.get(), out.data(), &written, in.data(), &read, nullptr);
    if (LZ4F_isError(hint) != 0 || (read == 0 && written == 0))
      return false;
    in = in.subspan(read);
    out = out.subspan(written);
  }
  return hint == 0 && in.empty() && out.empty();
}

bool decompress_zstd(std::span<const std::byte> in, std::span<std::byte> out) {
  return ZSTD_decompress(out.data(), out.size(), in.data(), in.size()) == out.size(); // errors are no valid size
}

} // namespace locus::tools
