// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <arpa/inet.h>
#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "config/config_fields.hpp"

/// Conversion of single configuration values from and to YAML. On invalid text parse() leaves its target unchanged and
/// returns a description of valid values.
namespace locus {

using Reason = std::optional<std::string>; ///< reason for rejecting a value; empty: accepted

/// Optional field; a word in the file stands for no value.
template <class T> struct OptionalWord {
  std::optional<T>& value;
  std::string_view word_for_none;
};

inline Reason parse(const YAML::Node& node, std::string& value) {
  if (!node.IsScalar())
    return "must be text (\"\" for none)";
  value = node.Scalar();
  return std::nullopt;
}

inline Reason parse(const YAML::Node& node, bool& value) {
  if (!YAML::convert<bool>::decode(node, value))
    return "must be true or false";
  return std::nullopt;
}

template <class T>
requires std::is_arithmetic_v<T> Reason parse(const YAML::Node& node, T& value) {
  const std::string text = node.IsScalar() ? node.Scalar() : "";
  T number{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  const bool read_to_the_end = error == std::errc{} && end == text.data() + text.size();
  if constexpr (std::is_floating_point_v<T>) {
    if (!read_to_the_end || !std::isfinite(number))
      return "must be a finite number";
  } else if (error == std::errc::result_out_of_range) {
    return fmt::format("is outside {} .. {}", std::numeric_limits<T>::min(), std::numeric_limits<T>::max());
  } else if (!read_to_the_end) {
    return std::is_signed_v<T> ? "must be a whole number" : "must be a whole number, 0 or more";
  }
  value = number;
  return std::nullopt;
}

/// Parses an enumerator by name. Also accepts false and true, to which YAML 1.1 tools convert a plain off and on.
template <class E>
requires std::is_enum_v<E> Reason parse(const YAML::Node& node, E& value) {
  const std::string word = node.IsScalar() ? node.Scalar() : "";
  const std::string_view written = word == "false" ? "off" : word == "true" ? "on" : std::string_view{word};
  const auto names = names_of(value);
  const auto* const name = std::ranges::find(names, written);
  if (name == names.end())
    return fmt::format("must be {}", fmt::join(names, " | "));
  value = static_cast<E>(name - names.begin());
  return std::nullopt;
}

template <std::size_t kCount> Reason parse(const YAML::Node& node, std::array<double, kCount>& values) {
  std::array<double, kCount> numbers{};
  bool fits = node.IsSequence() && node.size() == kCount;
  for (std::size_t i = 0; fits && i < kCount; ++i)
    fits = !parse(node[i], numbers[i]);
  if (!fits)
    return fmt::format("must be a list of {} finite numbers", kCount);
  values = numbers;
  return std::nullopt;
}

inline Reason parse(const YAML::Node& node, Eigen::Vector3d& value) {
  std::array<double, 3> numbers{};
  if (Reason reason = parse(node, numbers))
    return reason;
  value = Eigen::Vector3d{numbers.data()};
  return std::nullopt;
}

inline Reason parse(const YAML::Node& node, Ipv4& value) {
  in_addr address{};
  if (!node.IsScalar() || inet_pton(AF_INET, node.Scalar().c_str(), &address) != 1)
    return "must be an address such as 192.168.1.201";
  value.host_order = ntohl(address.s_addr);
  return std::nullopt;
}

template <class T> Reason parse(const YAML::Node& node, OptionalWord<T>& optional) {
  if (node.IsScalar() && node.Scalar() == optional.word_for_none) {
    optional.value.reset();
    return std::nullopt;
  }
  T value{};
  if (const Reason reason = parse(node, value))
    return fmt::format("{}, or {}", *reason, optional.word_for_none);
  optional.value = value;
  return std::nullopt;
}

inline YAML::Node to_node(const std::string& value) { return YAML::Node{value}; }
inline YAML::Node to_node(bool value) { return YAML::Node{value}; }

/// Formats a number as the shortest text that reads back to the same bits.
template <class T>
requires std::is_arithmetic_v<T> YAML::Node to_node(T value) { return YAML::Node{fmt::format("{}", value)}; }

template <class E>
requires std::is_enum_v<E> YAML::Node to_node(E value) { return YAML::Node{std::string{to_string(value)}}; }

template <class Numbers> YAML::Node list_node(const Numbers& numbers) {
  YAML::Node node{YAML::NodeType::Sequence};
  for (const double number : numbers)
    node.push_back(to_node(number));
  node.SetStyle(YAML::EmitterStyle::Flow);
  return node;
}
template <std::size_t kCount> YAML::Node to_node(const std::array<double, kCount>& values) { return list_node(values); }
inline YAML::Node to_node(const Eigen::Vector3d& value) { return list_node(value); }

inline YAML::Node to_node(const Ipv4& value) {
  const std::uint32_t ip = value.host_order;
  return YAML::Node{fmt::format("{}.{}.{}.{}", ip >> 24, ip >> 16 & 255, ip >> 8 & 255, ip & 255)};
}

template <class T> YAML::Node to_node(const OptionalWord<T>& optional) {
  return optional.value ? to_node(*optional.value) : YAML::Node{std::string{optional.word_for_none}};
}

} // namespace locus
