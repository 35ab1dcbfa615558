// SPDX-License-Identifier: Apache-2.0
#include "bags/ros1_record.hpp"

#include <fmt/format.h>

#include "bags/bag.hpp"
#include "bags/decompression.hpp"

namespace locus::tools {
namespace {

using Bytes = std::span<const std::byte>;

/// Removes a length-prefixed block and returns it.
std::optional<Bytes> pop_block(Bytes& bytes) {
  std::uint32_t length = 0;
  if (bytes.size() < sizeof(length))
    return std::nullopt;
  std::memcpy(&length, bytes.data(), sizeof(length));
  if (length > bytes.size() - sizeof(length))
    return std::nullopt;
  const Bytes block = bytes.subspan(sizeof(length), length);
  bytes = bytes.subspan(sizeof(length) + length);
  return block;
}

} // namespace

std::string_view BagFields::text(std::string_view name) const {
  Bytes left = bytes_;
  while (const std::optional<Bytes> field = pop_block(left)) {
    const std::string_view text(reinterpret_cast<const char*>(field->data()), field->size());
    if (text.size() > name.size() && text.starts_with(name) && text[name.size()] == '=')
      return text.substr(name.size() + 1);
  }
  return {};
}

std::optional<BagOp> BagFields::op() const {
  const auto value = number<std::uint8_t>("op");
  return value ? std::optional(static_cast<BagOp>(*value)) : std::nullopt;
}

std::optional<BagRecord> pop_record(Bytes& bytes) {
  const std::optional<Bytes> header = pop_block(bytes);
  const std::optional<Bytes> data = header ? pop_block(bytes) : std::nullopt;
  if (!data || !BagFields(*header).op())
    return std::nullopt;
  return BagRecord{BagFields(*header), *data};
}

std::optional<std::string> decompress_chunk(const BagRecord& chunk, std::vector<std::byte>& out) {
  const std::string_view compression = chunk.fields.text("compression");
  const auto size = chunk.fields.number<std::uint32_t>("size");
  if (!size || *size > kMaxBlockBytes)
    return fmt::format("a chunk of {} bytes", size ? std::to_string(*size) : "no");
  out.resize(*size);
  bool good = false;
  if (compression == "none") {
    good = chunk.data.size() == out.size();
    out.assign(chunk.data.begin(), chunk.data.end());
  } else if (compression == "lz4") {
    good = decompress_lz4(chunk.data, out);
  } else if (compression == "bz2") {
    good = decompress_bzip2(chunk.data, out);
  } else {
    return fmt::format("a chunk compressed by \"{}\"; none, lz4 and bz2 are read", printable(compression));
  }
  return good ? std::nullopt : std::optional<std::string>("a chunk is damaged");
}

} // namespace locus::tools
