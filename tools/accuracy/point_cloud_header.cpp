// SPDX-License-Identifier: Apache-2.0
#include "accuracy/point_cloud_header.hpp"

#include <algorithm>
#include <charconv>
#include <map>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "accuracy/pcd_header.hpp"

namespace locus {
namespace {

using Words = std::vector<std::string>;
using Encoding = PointCloudLayout::Encoding;
using Problem = std::optional<std::string>;

constexpr std::string_view kNotACloud = "neither a PLY nor a PCD file; export the map as one of them";

template <class Number> bool parse(const std::string& text, Number& number) {
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, number);
  return error == std::errc{} && stop == end;
}

/// Builds the layout that either header describes, line by line.
class LayoutBuilder {
 public:
  PointCloudLayout layout;

  /// Adds a property of every point: `count` numbers of `bytes` bytes each.
  Problem add(const std::string& name, std::size_t bytes, bool real, std::size_t count) {
    const std::size_t axis = std::string_view{"xyz"}.find(name);
    if (name.size() == 1 && axis != std::string_view::npos) {
      if (!real || (bytes != 4 && bytes != 8) || count != 1)
        return fmt::format("{} is neither a float nor a double; export the coordinates as one of them", name);
      layout.xyz[axis] = {columns_, layout.record_bytes, bytes};
    }
    columns_ += count;
    layout.record_bytes += bytes * count;
    return std::nullopt;
  }

  [[nodiscard]] Problem missing() const {
    const bool complete = std::ranges::all_of(layout.xyz, [](const auto& coordinate) { return coordinate.bytes > 0; });
    return complete ? std::nullopt : Problem{"the points lack x, y or z; export a map with coordinates"};
  }

 private:
  std::size_t columns_ = 0;
};

class PlyHeader {
 public:
  LayoutBuilder builder;

  /// Parses a line; sets `ended` at the last of the header.
  Problem read_line(const Words& words, bool& ended) {
    if (words.empty() || words[0] == "comment" || words[0] == "obj_info" || words[0] == "ply")
      return std::nullopt;
    if (words[0] == "end_header") {
      ended = true;
      return builder.missing();
    }
    if (words.size() == 3 && words[0] == "format")
      return read_format(words[1]);
    if (words.size() == 3 && words[0] == "element")
      return read_element(words);
    if (words.size() >= 3 && words[0] == "property")
      return in_vertex_ ? read_property(words) : std::nullopt;
    return "not a line of a PLY header; export the map again";
  }

 private:
  Problem read_format(const std::string& name) {
    static const std::map<std::string, Encoding> kEncodings{{"ascii", Encoding::text},
                                                            {"binary_little_endian", Encoding::little_endian},
                                                            {"binary_big_endian", Encoding::big_endian}};
    const auto found = kEncodings.find(name);
    if (found == kEncodings.end())
      return fmt::format("unknown format {}; export the map as binary_little_endian", name);
    builder.layout.encoding = found->second;
    return std::nullopt;
  }

  Problem read_element(const Words& words) {
    in_vertex_ = words[1] == "vertex";
    if (in_vertex_ && elements_ > 0)
      return "the element vertex is not the first; export the points alone";
    ++elements_;
    if (in_vertex_ && !parse(words[2], builder.layout.points))
      return fmt::format("{} is not a number of points; export the map again", words[2]);
    return std::nullopt;
  }

  Problem read_property(const Words& words) {
    static const std::map<std::string, std::pair<std::size_t, bool>> kTypes{
        {"char", {1, false}},  {"int8", {1, false}},   {"uchar", {1, false}},  {"uint8", {1, false}},
        {"short", {2, false}}, {"int16", {2, false}},  {"ushort", {2, false}}, {"uint16", {2, false}},
        {"int", {4, false}},   {"int32", {4, false}},  {"uint", {4, false}},   {"uint32", {4, false}},
        {"float", {4, true}},  {"float32", {4, true}}, {"double", {8, true}},  {"float64", {8, true}}};
    const auto type = kTypes.find(words[1]);
    if (type == kTypes.end())
      return fmt::format("a property of type {} in the points; export the coordinates alone", words[1]);
    return builder.add(words[2], type->second.first, type->second.second, 1);
  }

  bool in_vertex_ = false;
  int elements_ = 0;
};

Expected<PointCloudLayout, std::string> read_ply_header(std::istream& stream) {
  PlyHeader header;
  bool ended = false;
  std::uint64_t number = 2; // line number; the first line has been read
  for (; true; ++number) {
    const std::optional<std::string> line = read_short_line(stream);
    if (!line)
      return fmt::format("{}: the header does not end; export the map again", number);
    if (Problem problem = header.read_line(words_of(*line), ended))
      return fmt::format("{}: {}", number, *problem);
    if (ended)
      break;
  }
  header.builder.layout.header_lines = number;
  return header.builder.layout;
}

Expected<PointCloudLayout, std::string> read_pcd_header(std::istream& stream) {
  const Expected<PcdHeader, std::string> header = PcdHeader::read(stream);
  if (!header)
    return header.error();
  if (header->data == PcdHeader::Data::binary_compressed)
    return fmt::format("{}: DATA binary_compressed cannot be read in parts; convert the map to DATA binary",
                       header->lines);
  LayoutBuilder builder;
  builder.layout.points = header->points;
  builder.layout.header_lines = header->lines;
  builder.layout.encoding = header->data == PcdHeader::Data::ascii ? Encoding::text : Encoding::little_endian;
  for (const PcdHeader::Field& field : header->fields) {
    if (const Problem problem = builder.add(field.name, field.bytes, field.type == 'F', field.count))
      return fmt::format("{}: {}", header->lines, *problem);
  }
  if (const Problem problem = builder.missing())
    return fmt::format("{}: {}", header->lines, *problem);
  return builder.layout;
}

} // namespace

Expected<PointCloudLayout, std::string> PointCloudLayout::read(std::istream& stream) {
  const std::string first = read_short_line(stream).value_or("");
  if (const Words words = words_of(first); !words.empty() && words[0] == "ply")
    return read_ply_header(stream);
  if (!PcdHeader::begins_with(first))
    return fmt::format("1: {}", kNotACloud);
  stream.seekg(0);
  return read_pcd_header(stream);
}

} // namespace locus
