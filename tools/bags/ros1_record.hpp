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

/// Records of a ROS 1 bag (format 2.0).
namespace locus::tools {

enum class BagOp : std::uint8_t { message = 2, bag_header = 3, index = 4, chunk = 5, chunk_info = 6, connection = 7 };

/// Fields of a header: `name=value`, each prefixed by its length.
class BagFields {
 public:
  explicit BagFields(std::span<const std::byte> bytes = {}) : bytes_(bytes) {}

  /// Returns empty text if the field is absent or the lengths before it are invalid.
  [[nodiscard]] std::string_view text(std::string_view name) const;
  /// Returns nothing if the field is absent or of another size.
  template <class Number> [[nodiscard]] std::optional<Number> number(std::string_view name) const {
    const std::string_view value = text(name);
    Number number{};
    if (value.size() != sizeof(Number))
      return std::nullopt;
    std::memcpy(&number, value.data(), sizeof(Number));
    return number;
  }
  /// Returns nothing if the fields are not those of a record.
  [[nodiscard]] std::optional<BagOp> op() const;

 private:
  std::span<const std::byte> bytes_;
};

struct BagRecord {
  BagFields fields;
  std::span<const std::byte> data;
};

/// Removes the first record from the bytes and returns it; nothing if they do not start with a complete one.
std::optional<BagRecord> pop_record(std::span<const std::byte>& bytes);

/// Decompresses the data of a chunk. Returns the problem, or nothing.
std::optional<std::string> decompress_chunk(const BagRecord& chunk, std::vector<std::byte>& out);

} // namespace locus::tools
