// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/cloud_files.hpp"

#include <bit>
#include <cstdint>
#include <string>

#include <fmt/format.h>

#include "locus_replay/output_file.hpp"

namespace locus::tools {
namespace {

static_assert(std::endian::native == std::endian::little,
              "files have the byte order of the machine, which must be little-endian");

std::size_t bytes_of(const CloudColumn& column) {
  return column.type == CloudColumn::Type::float32 ? sizeof(float) : sizeof(std::uint16_t);
}

std::size_t points_in(std::span<const CloudColumn> columns, std::span<const std::byte> records) {
  std::size_t record_bytes = 0;
  for (const CloudColumn& column : columns)
    record_bytes += bytes_of(column);
  return records.size() / record_bytes;
}

void write(const std::filesystem::path& path, const std::string& header, std::span<const std::byte> records) {
  OutputFile file(path);
  file.print("{}", header);
  file.write(records);
  file.close();
}

} // namespace

void write_pcd(const std::filesystem::path& path, std::span<const CloudColumn> columns,
               std::span<const std::byte> records) {
  std::string fields, sizes, types, counts;
  for (const CloudColumn& column : columns) {
    fields += fmt::format(" {}", column.name);
    sizes += fmt::format(" {}", bytes_of(column));
    types += column.type == CloudColumn::Type::float32 ? " F" : " U";
    counts += " 1";
  }
  write(path,
        fmt::format("# .PCD v0.7 - Point Cloud Data file format\n"
                    "VERSION 0.7\n"
                    "FIELDS{0}\n"
                    "SIZE{1}\n"
                    "TYPE{2}\n"
                    "COUNT{3}\n"
                    "WIDTH {4}\n"
                    "HEIGHT 1\n"
                    "VIEWPOINT 0 0 0 1 0 0 0\n"
                    "POINTS {4}\n"
                    "DATA binary\n",
                    fields, sizes, types, counts, points_in(columns, records)),
        records);
}

void write_ply(const std::filesystem::path& path, std::span<const CloudColumn> columns,
               std::span<const std::byte> records) {
  std::string header =
      fmt::format("ply\nformat binary_little_endian 1.0\nelement vertex {}\n", points_in(columns, records));
  for (const CloudColumn& column : columns)
    header +=
        fmt::format("property {} {}\n", column.type == CloudColumn::Type::float32 ? "float" : "ushort", column.name);
  write(path, header + "end_header\n", records);
}

} // namespace locus::tools
