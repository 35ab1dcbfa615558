// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

namespace locus::ouster {

/// Error of a metadata file and the key that it concerns; no key: the whole file. Thrown by the functions below, and
/// caught by parse_metadata().
struct Problem {
  std::string key, what;
};

/// Section name, and its name in the flat form: empty (the root) except for the data format.
struct Section {
  std::string_view name, flat_name;
};
/// Metadata file in either form, with sections or flat. Refers to the JSON that it is made from.
class Document {
 public:
  /// Throws if it is not the metadata of an Ouster sensor, or a section is missing.
  explicit Document(const nlohmann::json& root);

  /// Returns the value; nullptr if the key or its section is missing.
  [[nodiscard]] const nlohmann::json* find(const Section& section, std::string_view key) const;
  [[nodiscard]] bool has(const Section& section) const { return keys_of(section) != nullptr; }

  /// Returns the key as the file has it, e.g. "config_params.lidar_mode".
  [[nodiscard]] std::string path(const Section& section, std::string_view key) const;
  [[nodiscard]] Problem problem(const Section& section, std::string_view key, std::string what) const;

 private:
  [[nodiscard]] const nlohmann::json* keys_of(const Section& section) const;

  const nlohmann::json& root_;
  bool nested_ = false;
};

/// Reads a value, as text or in the unit of the file; empty if the key is missing. Throws if it is of another kind, not
/// finite, or for a count not a whole number from `least` to `most`.
std::optional<std::string> text(const Document& file, const Section& section, std::string_view key);
std::optional<double> number(const Document& file, const Section& section, std::string_view key);
std::optional<std::size_t> count(const Document& file, const Section& section, std::string_view key, std::size_t least,
                                 std::size_t most);

/// Reads a list of `size` finite numbers; empty if the key is missing. `what` ends the error of a list of another size,
/// e.g. "a column has 64 pixels".
std::optional<std::vector<double>> numbers(const Document& file, const Section& section, std::string_view key,
                                           std::size_t size, std::string_view what);

/// Returns the value; throws if there is none.
template <class T>
T needed(const Document& file, const Section& section, std::string_view key, std::optional<T> value) {
  if (!value)
    throw file.problem(section, key, "is missing");
  return *value;
}

} // namespace locus::ouster
