// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <type_traits>

namespace locus::tools {

/// How messages are written in a bag: ROS 1's way, everything packed, or CDR behind its four bytes of encapsulation,
/// every number aligned to its size. Numbers are little-endian in both.
enum class Serialisation { ros1, cdr };

/// Takes the fields of a message off its bytes, one after the other. Beyond their end everything is 0 and whole() is
/// false. Owns nothing.
class MessageReader {
 public:
  MessageReader() = default;
  MessageReader(std::span<const std::byte> data, Serialisation serialisation);

  template <class Number> Number number() {
    static_assert(std::is_arithmetic_v<Number> && std::endian::native == std::endian::little);
    align(sizeof(Number));
    Number value{};
    if (const auto taken = bytes(sizeof(Number)); !taken.empty())
      std::memcpy(&value, taken.data(), sizeof(Number));
    return value;
  }
  void numbers(std::span<double> out) {
    for (double& value : out)
      value = number<double>();
  }
  /// Empty where there are not so many left.
  std::span<const std::byte> bytes(std::size_t count);
  void skip_text() { bytes(number<std::uint32_t>()); }

  [[nodiscard]] Serialisation serialisation() const { return serialisation_; }
  /// Whether all that was asked for was there.
  [[nodiscard]] bool whole() const { return whole_; }

 private:
  void align(std::size_t size);

  std::span<const std::byte> data_; ///< what CDR aligns from its beginning
  std::size_t at_ = 0;
  Serialisation serialisation_ = Serialisation::ros1;
  bool whole_ = true;
};

} // namespace locus::tools
