// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

/// What the file of a ROS 1 bag (format 2.0) is made of.
namespace locus::tools {

enum class BagOp : std::uint8_t { message = 2, bag_header = 3, index = 4, chunk = 5, chunk_info = 6, connection = 7 };

/// The fields of a header, `name=value` each behind its length.
class BagFields {
 public:
  explicit BagFields(std::span<const std::byte> bytes = {}) : bytes_(bytes) {}

  /// Empty where there is none, or the lengths before it do not fit.
  [[nodiscard]] std::string_view text(std::string_view name) const;
  /// Nothing where there is none of this size.
  template <class Number> [[nodiscard]] std::optional<Number> number(std::string_view name) const {
    const std::string_view value = text(name);
    Number number{};
    if (value.size() != sizeof(Number))
      return std::nullopt;
    std::memcpy(&number, value.data(), sizeof(Number));
    return number;
  }
  /// Nothing where the fields are none of a record.
  [[nodiscard]] std::optional<BagOp> op() const;

 private:
  std::span<const std::byte> bytes_;
};

struct BagRecord {
  BagFields fields;
  std::span<const std::byte> data;
};

/// Takes the first record off the bytes; nothing where they do not begin with a whole one.
std::optional<BagRecord> take_record(std::span<const std::byte>& bytes);

/// Brings the data of a chunk to their old size. What is wrong with them, or nothing.
std::optional<std::string> decompress_chunk(const BagRecord& chunk, std::vector<std::byte>& out);

} // namespace locus::tools
