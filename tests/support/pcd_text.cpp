// SPDX-License-Identifier: Apache-2.0
#include "support/pcd_text.hpp"

#include <algorithm>
#include <array>
#include <cstdint>

#include <fmt/format.h>

namespace locus::test {
namespace {

using Type = CloudView::Type;

std::size_t size_of(Type type) {
  constexpr std::array<std::size_t, 9> kBytes{0, 1, 1, 2, 2, 4, 4, 4, 8};
  return kBytes[static_cast<std::size_t>(type)];
}

char letter_of(Type type) {
  if (type == Type::float32 || type == Type::float64)
    return 'F';
  return type == Type::uint8 || type == Type::uint16 || type == Type::uint32 ? 'U' : 'I';
}

std::string header_of(const OwnCloud& cloud, const std::string& encoding) {
  std::string fields = "FIELDS", sizes = "SIZE", types = "TYPE", counts = "COUNT";
  for (const OwnCloud::Field& field : cloud.fields) {
    fields += " " + field.name;
    sizes += fmt::format(" {}", size_of(field.type));
    types += fmt::format(" {}", letter_of(field.type));
    counts += " 1";
  }
  return fmt::format("# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\n{}\n{}\n{}\n{}\nWIDTH {}\nHEIGHT {}\n"
                     "VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {}\nDATA {}\n",
                     fields, sizes, types, counts, cloud.width, cloud.height, cloud.width * cloud.height, encoding);
}

std::string bytes_at(const OwnCloud& cloud, std::size_t point, const OwnCloud::Field& field) {
  return {reinterpret_cast<const char*>(cloud.data.data()) + point * cloud.point_step + field.offset,
          size_of(field.type)};
}

std::string text_at(const OwnCloud& cloud, std::size_t point, const OwnCloud::Field& field) {
  switch (field.type) {
  case Type::int8:
    return fmt::format("{}", cloud.get<std::int8_t>(point, field.name));
  case Type::uint8:
    return fmt::format("{}", cloud.get<std::uint8_t>(point, field.name));
  case Type::int16:
    return fmt::format("{}", cloud.get<std::int16_t>(point, field.name));
  case Type::uint16:
    return fmt::format("{}", cloud.get<std::uint16_t>(point, field.name));
  case Type::int32:
    return fmt::format("{}", cloud.get<std::int32_t>(point, field.name));
  case Type::uint32:
    return fmt::format("{}", cloud.get<std::uint32_t>(point, field.name));
  case Type::float32:
    return fmt::format("{}", cloud.get<float>(point, field.name));
  case Type::float64:
    return fmt::format("{}", cloud.get<double>(point, field.name));
  }
  return "";
}

std::string little_endian(std::size_t number) {
  const auto value = static_cast<std::uint32_t>(number);
  return {reinterpret_cast<const char*>(&value), sizeof(value)};
}

} // namespace

std::string pcd_as_text(const OwnCloud& cloud) {
  std::string text = header_of(cloud, "ascii");
  for (std::size_t i = 0; i < std::size_t{cloud.width} * cloud.height; ++i) {
    for (const OwnCloud::Field& field : cloud.fields)
      text += text_at(cloud, i, field) + " ";
    text.back() = '\n';
  }
  return text;
}

std::string pcd_as_binary(const OwnCloud& cloud) {
  std::string text = header_of(cloud, "binary");
  for (std::size_t i = 0; i < std::size_t{cloud.width} * cloud.height; ++i) {
    for (const OwnCloud::Field& field : cloud.fields)
      text += bytes_at(cloud, i, field);
  }
  return text;
}

std::string pcd_compressed(const OwnCloud& cloud) {
  std::string columns;
  for (const OwnCloud::Field& field : cloud.fields) {
    for (std::size_t i = 0; i < std::size_t{cloud.width} * cloud.height; ++i)
      columns += bytes_at(cloud, i, field);
  }
  const std::string packed = packed_by_lzf(columns);
  return header_of(cloud, "binary_compressed") + little_endian(packed.size()) + little_endian(columns.size()) + packed;
}

std::string packed_by_lzf(const std::string& bytes) {
  constexpr std::size_t kMostLiterals = 32, kLeastRun = 4, kMostRun = 264;
  std::string packed, literals;
  const auto flush = [&] {
    if (literals.empty())
      return;
    packed += static_cast<char>(literals.size() - 1);
    packed += literals;
    literals.clear();
  };
  for (std::size_t i = 0; i < bytes.size();) {
    std::size_t run = 0; // of the previous byte
    while (i > 0 && run < kMostRun && i + run < bytes.size() && bytes[i + run] == bytes[i - 1])
      ++run;
    if (run < kLeastRun) {
      literals += bytes[i++];
      if (literals.size() == kMostLiterals)
        flush();
      continue;
    }
    flush();
    const std::size_t length = run - 2;
    packed += static_cast<char>(std::min<std::size_t>(length, 7) << 5U);
    if (length >= 7)
      packed += static_cast<char>(length - 7);
    packed += '\0'; // offset: one byte back
    i += run;
  }
  flush();
  return packed;
}

} // namespace locus::test
