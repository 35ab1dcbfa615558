// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string_view>
#include <type_traits>

namespace locus {

/// Serialisation of ROS messages: packed (ROS 1), or CDR after a four-byte encapsulation header, with numbers aligned
/// to their size. Little-endian in both.
enum class Serialisation { ros1, cdr };

/// Reads the fields of a message in sequence. Past the end, returns zeros and sets whole() to false. Non-owning.
class MessageReader {
 public:
  MessageReader() = default;
  MessageReader(std::span<const std::byte> data, Serialisation serialisation);

  template <class Number> Number number() {
    static_assert(std::is_arithmetic_v<Number> && std::endian::native == std::endian::little);
    align(sizeof(Number));
    Number value{};
    if (const auto data = bytes(sizeof(Number)); !data.empty())
      std::memcpy(&value, data.data(), sizeof(Number));
    return value;
  }
  void numbers(std::span<double> out) {
    for (double& value : out)
      value = number<double>();
  }
  /// Returns the next `count` bytes; empty if fewer are left.
  std::span<const std::byte> bytes(std::size_t count);
  /// Returns a length-prefixed byte sequence.
  std::span<const std::byte> sequence() { return bytes(number<std::uint32_t>()); }
  std::span<const std::byte> rest() { return bytes(data_.size() - at_); }
  std::string_view text() {
    const std::span<const std::byte> data = sequence();
    const std::string_view all{reinterpret_cast<const char*>(data.data()), data.size()};
    return all.substr(0, all.find('\0')); // CDR includes the terminating zero
  }

  [[nodiscard]] Serialisation serialisation() const { return serialisation_; }
  /// Returns true if no read went past the end.
  [[nodiscard]] bool whole() const { return whole_; }

 private:
  void align(std::size_t size);

  std::span<const std::byte> data_; ///< CDR alignment is relative to its start
  std::size_t at_ = 0;
  Serialisation serialisation_ = Serialisation::ros1;
  bool whole_ = true;
};

} // namespace locus
