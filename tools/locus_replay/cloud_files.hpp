// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <span>
#include <string_view>

#include "core/base/names.hpp"

namespace locus::tools {

enum class CloudFormat { pcd, ply, bin };
constexpr auto names_of(CloudFormat) { return std::to_array<std::string_view>({"pcd", "ply", "bin"}); }

/// Number in the record of a point. Records have no padding.
struct CloudColumn {
  enum class Type { float32, uint16 };

  std::string_view name;
  Type type = Type::float32;
};

/// Writes points as a binary PCD or PLY. `records` holds the points one after the other, each with all columns.
/// Hand-written, because no more of either format is needed and libpcl-io depends on VTK. Throws Failure.
void write_pcd(const std::filesystem::path& path, std::span<const CloudColumn> columns,
               std::span<const std::byte> records);
void write_ply(const std::filesystem::path& path, std::span<const CloudColumn> columns,
               std::span<const std::byte> records);

} // namespace locus::tools
