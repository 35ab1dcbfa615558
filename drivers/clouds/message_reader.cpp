// SPDX-License-Identifier: Apache-2.0
#include "drivers/clouds/message_reader.hpp"

namespace locus {

MessageReader::MessageReader(std::span<const std::byte> data, Serialisation serialisation)
    : data_(data), serialisation_(serialisation) {
  constexpr std::size_t kEncapsulation = 4;
  constexpr std::byte kLittleEndianCdr{1};
  if (serialisation == Serialisation::ros1)
    return;
  whole_ = data.size() >= kEncapsulation && data[0] == std::byte{0} && data[1] == kLittleEndianCdr;
  data_ = whole_ ? data.subspan(kEncapsulation) : std::span<const std::byte>{};
}

std::span<const std::byte> MessageReader::bytes(std::size_t count) {
  whole_ = whole_ && count <= data_.size() - at_;
  if (!whole_)
    return {};
  at_ += count;
  return data_.subspan(at_ - count, count);
}

void MessageReader::align(std::size_t size) {
  if (serialisation_ == Serialisation::cdr)
    bytes((size - at_ % size) % size);
}

} // namespace locus
