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

/// How ROS writes messages: ROS 1's way, everything packed, or CDR behind its four bytes of encapsulation,
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
  /// A sequence of bytes behind its length.
  std::span<const std::byte> sequence() { return bytes(number<std::uint32_t>()); }
  std::span<const std::byte> rest() { return bytes(data_.size() - at_); }
  std::string_view text() {
    const std::span<const std::byte> taken = sequence();
    const std::string_view all{reinterpret_cast<const char*>(taken.data()), taken.size()};
    return all.substr(0, all.find('\0')); // CDR counts the zero at its end
  }

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

} // namespace locus
