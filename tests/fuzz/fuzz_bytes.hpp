// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <span>
#include <string_view>
#include <type_traits>

namespace locus::fuzz {

/// Input of a target, consumed from the front, so that seeds can be written by hand; zeros once it is exhausted.
class FuzzBytes {
 public:
  FuzzBytes(const std::uint8_t* data, std::size_t size) : rest_(std::as_bytes(std::span{data, size})) {}

  [[nodiscard]] bool empty() const { return rest_.empty(); }
  [[nodiscard]] std::span<const std::byte> rest() const { return rest_; }

  /// Overwrites as much of `target` as bytes are left.
  void fill(std::span<std::byte> target) {
    const std::size_t count = std::min(target.size(), rest_.size());
    std::copy_n(rest_.begin(), count, target.begin());
    rest_ = rest_.subspan(count);
  }
  template <class T> T take() {
    static_assert(std::is_arithmetic_v<T> && !std::is_same_v<T, bool>);
    T value{};
    fill(std::as_writable_bytes(std::span{&value, 1}));
    return value;
  }

 private:
  std::span<const std::byte> rest_;
};

inline std::string_view text_of(const std::uint8_t* data, std::size_t size) {
  return {reinterpret_cast<const char*>(data), size};
}

/// Checks an invariant. Not assert(), which release builds omit.
inline void demand(bool holds) {
  if (!holds)
    std::abort();
}

} // namespace locus::fuzz
