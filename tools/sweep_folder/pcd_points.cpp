// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <bit>
#include <charconv>
#include <cstring>
#include <fstream>
#include <limits>
#include <string_view>
#include <system_error>
#include <type_traits>
#include <utility>

#include <fmt/format.h>

#include "accuracy/pcd_header.hpp"
#include "drivers/clouds/cloud_layout.hpp"
#include "sweep_folder/lzf.hpp"
#include "sweep_folder/sweep_points.hpp"

namespace locus::tools {
namespace {

using Problem = std::optional<std::string>;
using Type = CloudView::Type;
using PcdField = PcdHeader::Field;

static_assert(std::endian::native == std::endian::little, "a PCD has the bytes of little-endian machines");

/// Returns the type of a field's numbers; nothing for one that a cloud cannot have.
std::optional<Type> type_of(const PcdField& field) {
  const auto choose = [&](Type one, Type two, Type four) -> std::optional<Type> {
    switch (field.bytes) {
    case 1:
      return one;
    case 2:
      return two;
    case 4:
      return four;
    case 8:
      return Type::float64; // converted on reading
    default:
      return std::nullopt;
    }
  };
  if (field.type == 'U')
    return choose(Type::uint8, Type::uint16, Type::uint32);
  if (field.type == 'I')
    return choose(Type::int8, Type::int16, Type::int32);
  if (field.type == 'F' && (field.bytes == sizeof(float) || field.bytes == sizeof(double)))
    return field.bytes == sizeof(float) ? Type::float32 : Type::float64;
  return std::nullopt;
}

bool is_long(const PcdField& field) { return field.type != 'F' && field.bytes == sizeof(std::int64_t); }

/// Calls `visit` with each field and its offset.
template <class Visit> void for_each_field(const PcdHeader& header, Visit&& visit) {
  std::size_t offset = 0;
  for (const PcdField& field : header.fields) {
    visit(field, offset);
    offset += field.bytes * field.count;
  }
}

Problem apply_header(const PcdHeader& header, SweepPoints& points) {
  const std::size_t step = header.record_bytes();
  if (header.points > kMaxCloudPoints || header.points * step > SweepPoints::kMostBytes)
    return fmt::format(
        "{} points of {} bytes are more than a sweep may have ({} points, {} bytes); this looks like a map",
        header.points, step, kMaxCloudPoints, SweepPoints::kMostBytes);
  const bool is_organised = header.width > 0 && header.height > 0 && header.points % header.width == 0 &&
                            header.points / header.width == header.height;
  points.width = static_cast<std::uint32_t>(is_organised ? header.width : header.points);
  points.height = static_cast<std::uint32_t>(is_organised ? header.height : 1);
  points.point_step = static_cast<std::uint32_t>(step);
  points.fields.clear();
  for_each_field(header, [&](const PcdField& field, std::size_t offset) {
    const std::optional<Type> type = field.count == 1 ? type_of(field) : std::nullopt;
    if (type)
      points.fields.push_back({field.name, static_cast<std::uint32_t>(offset), *type});
  });
  for (const char* const name : {"x", "y", "z"}) {
    if (std::ranges::find(points.fields, name, &SweepPoints::Field::name) == points.fields.end())
      return fmt::format("its points have no {}; export it with coordinates", name);
  }
  points.data.resize(header.points * step);
  return std::nullopt;
}

/// Parses and stores a number; false if it is not one of the type.
template <class Number> bool write_number(std::string_view word, std::byte* to) {
  Number number{};
  const auto [stop, error] = std::from_chars(word.data(), word.data() + word.size(), number);
  std::memcpy(to, &number, sizeof(number));
  return error == std::errc{} && stop == word.data() + word.size();
}

bool write_word(std::string_view word, const PcdField& field, std::byte* to) {
  const auto write_whole = [&]<class One, class Two, class Four, class Eight>(One, Two, Four, Eight) {
    switch (field.bytes) {
    case 1:
      return write_number<One>(word, to);
    case 2:
      return write_number<Two>(word, to);
    case 4:
      return write_number<Four>(word, to);
    default:
      return write_number<Eight>(word, to);
    }
  };
  if (field.type == 'U')
    return write_whole(std::uint8_t{}, std::uint16_t{}, std::uint32_t{}, std::uint64_t{});
  if (field.type == 'I')
    return write_whole(std::int8_t{}, std::int16_t{}, std::int32_t{}, std::int64_t{});
  return field.bytes == sizeof(double) ? write_number<double>(word, to) : write_number<float>(word, to);
}

/// Parses a point in a line of text.
bool read_record(std::string_view line, const PcdHeader& header, std::byte* record) {
  const auto next_word = [&] {
    line.remove_prefix(std::min(line.find_first_not_of(" \t\r"), line.size()));
    const std::string_view word = line.substr(0, line.find_first_of(" \t\r"));
    line.remove_prefix(word.size());
    return word;
  };
  for (const PcdField& field : header.fields) {
    const bool is_read = field.count == 1 && type_of(field);
    for (std::size_t i = 0; i < field.count; ++i, record += field.bytes) {
      const std::string_view word = next_word();
      if (word.empty() || (is_read && !write_word(word, field, record)))
        return false;
    }
  }
  return next_word().empty();
}

Problem read_ascii(std::istream& stream, const PcdHeader& header, SweepPoints& points) {
  for (std::uint64_t i = 0; i < header.points; ++i) {
    const std::optional<std::string> line = read_short_line(stream);
    if (!line)
      return fmt::format("{}: the file ends after {} of {} points; copy it again", header.lines + i + 1, i,
                         header.points);
    if (!read_record(*line, header, points.data.data() + i * points.point_step))
      return fmt::format("{}: not the {} fields of a point; export it again", header.lines + i + 1,
                         header.fields.size());
  }
  return std::nullopt;
}

bool read_bytes(std::istream& stream, std::span<std::byte> bytes) {
  return bytes.empty() ||
         stream.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
}

/// Reads compressed points, which are stored field by field.
Problem read_compressed(std::istream& stream, std::uint64_t left, const PcdHeader& header, SweepPoints& points) {
  std::array<std::uint32_t, 2> sizes{}; // compressed, uncompressed
  if (!read_bytes(stream, std::as_writable_bytes(std::span(sizes))) || sizes[0] > left - sizeof(sizes))
    return "its compressed points are truncated; copy it again";
  const std::size_t most_packed = points.data.size() + points.data.size() / 32 + 16; // without any repetition
  if (sizes[1] != points.data.size() || sizes[0] > most_packed)
    return fmt::format("its compressed points are damaged, or not {} points; copy it again", header.points);
  std::vector<std::byte> packed(sizes[0]), columns(points.data.size());
  if (!read_bytes(stream, packed) || !unpack_lzf(packed, columns))
    return fmt::format("its compressed points are damaged, or not {} points; copy it again", header.points);
  const std::byte* from = columns.data();
  for_each_field(header, [&](const PcdField& field, std::size_t offset) {
    const std::size_t bytes = field.bytes * field.count;
    for (std::uint64_t i = 0; i < header.points; ++i, from += bytes)
      std::memcpy(points.data.data() + i * points.point_step + offset, from, bytes);
  });
  return std::nullopt;
}

template <class Whole> void make_double(std::byte* number) {
  Whole whole{};
  std::memcpy(&whole, number, sizeof(whole));
  const auto real = static_cast<double>(whole);
  std::memcpy(number, &real, sizeof(real));
}

void make_long_ones_double(const PcdHeader& header, SweepPoints& points) {
  for_each_field(header, [&](const PcdField& field, std::size_t offset) {
    for (std::uint64_t i = 0; is_long(field) && field.count == 1 && i < header.points; ++i) {
      std::byte* const number = points.data.data() + i * points.point_step + offset;
      field.type == 'U' ? make_double<std::uint64_t>(number) : make_double<std::int64_t>(number);
    }
  });
}

} // namespace

Problem read_pcd_points(const std::filesystem::path& file, SweepPoints& points) {
  std::ifstream stream{file, std::ios::binary};
  if (!stream)
    return "cannot be read; check its permissions";
  const Expected<PcdHeader, std::string> header = PcdHeader::read(stream);
  if (!header)
    return header.error();
  if (Problem problem = apply_header(*header, points))
    return problem;
  const auto begin = static_cast<std::uint64_t>(stream.tellg());
  std::error_code error;
  const std::uint64_t size = std::filesystem::file_size(file, error);
  const std::uint64_t left = error || size < begin ? 0 : size - begin;
  Problem problem;
  if (header->data == PcdHeader::Data::ascii)
    problem = read_ascii(stream, *header, points);
  else if (header->data == PcdHeader::Data::binary_compressed)
    problem = read_compressed(stream, left, *header, points);
  else if (points.data.size() > left || !read_bytes(stream, points.data))
    problem = fmt::format("ends at byte {} after {} of {} points; copy it again", size, left / points.point_step,
                          header->points);
  if (!problem)
    make_long_ones_double(*header, points);
  return problem;
}

} // namespace locus::tools
