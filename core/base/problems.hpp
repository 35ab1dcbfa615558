// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <charconv>
#include <optional>
#include <string>
#include <string_view>

namespace locus {

/// Collects the problems of a set of options, one line "key: reason" for each key.
class Problems {
 public:
  void require(bool holds, std::string_view key, std::string_view reason) {
    if (holds)
      return;
    std::string line = std::string{key}.append(": ").append(reason);
    std::replace(line.begin(), line.end(), '\n', ' '); // a reason may quote any text
    add(line);
  }

  /// NaN is outside every range.
  template <class T> void require_range(std::string_view key, T value, T lowest, T highest) {
    require(value >= lowest && value <= highest, key,
            shortest(value) + " is outside " + shortest(lowest) + " .. " + shortest(highest));
  }

  void add(const std::optional<std::string>& lines) {
    if (lines)
      text_ += text_.empty() ? *lines : '\n' + *lines;
  }

  [[nodiscard]] std::optional<std::string> result() const {
    return text_.empty() ? std::nullopt : std::optional{text_};
  }

 private:
  template <class T> static std::string shortest(T value) {
    std::array<char, 32> buffer{};
    return {buffer.data(), std::to_chars(buffer.data(), buffer.data() + buffer.size(), value).ptr};
  }

  std::string text_;
};

} // namespace locus
