// SPDX-License-Identifier: Apache-2.0
#include "sweep_folder/lzf.hpp"

#include <algorithm>

namespace locus::tools {

bool unpack_lzf(std::span<const std::byte> packed, std::span<std::byte> out) {
  constexpr std::size_t kLiterals = 32, kLengthShift = 5, kLongLength = 7, kLeast = 2, kFarMask = 0x1F, kPerByte = 256;
  std::size_t in = 0, filled = 0;
  const auto next = [&] { return in < packed.size() ? static_cast<std::size_t>(packed[in++]) : std::size_t{0}; };
  while (in < packed.size()) {
    const std::size_t control = next();
    if (control < kLiterals) {
      const std::size_t count = control + 1;
      if (count > packed.size() - in || count > out.size() - filled)
        return false;
      std::ranges::copy(packed.subspan(in, count), out.begin() + static_cast<std::ptrdiff_t>(filled));
      in += count;
      filled += count;
      continue;
    }
    std::size_t length = control >> kLengthShift;
    if (length == kLongLength)
      length += next();
    length += kLeast;
    if (in == packed.size())
      return false;
    const std::size_t back = (control & kFarMask) * kPerByte + next() + 1;
    if (back > filled || length > out.size() - filled)
      return false;
    for (std::size_t i = 0; i < length; ++i, ++filled) // source and destination may overlap
      out[filled] = out[filled - back];
  }
  return filled == out.size();
}

} // namespace locus::tools
