// SPDX-License-Identifier: Apache-2.0
#include "accuracy/point_cloud_header.hpp"

#include <algorithm>
#include <charconv>
#include <map>
#include <sstream>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>

namespace locus {
namespace {

using Words = std::vector<std::string>;
using Encoding = PointCloudLayout::Encoding;
using Problem = std::optional<std::string>;

constexpr std::string_view kNotACloud = "neither a PLY nor a PCD file; export the map as one of them";

Words words_of(const std::string& line) {
  std::istringstream stream{line};
  Words words;
  for (std::string word; stream >> word;)
    words.push_back(word);
  return words;
}

template <class Number> bool parse(const std::string& text, Number& number) {
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, number);
  return error == std::errc{} && stop == end;
}

/// What both headers describe, put together line by line.
class LayoutBuilder {
 public:
  PointCloudLayout layout;

  /// A property of every point, `count` numbers of `bytes` bytes each.
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

  /// Takes a line in; `ended` at the last of the header.
  Problem take(const Words& words, bool& ended) {
    if (words.empty() || words[0] == "comment" || words[0] == "obj_info" || words[0] == "ply")
      return std::nullopt;
    if (words[0] == "end_header") {
      ended = true;
      return builder.missing();
    }
    if (words.size() == 3 && words[0] == "format")
      return take_format(words[1]);
    if (words.size() == 3 && words[0] == "element")
      return take_element(words);
    if (words.size() >= 3 && words[0] == "property")
      return in_vertex_ ? take_property(words) : std::nullopt;
    return "not a line of a PLY header; export the map again";
  }

 private:
  Problem take_format(const std::string& name) {
    static const std::map<std::string, Encoding> kEncodings{{"ascii", Encoding::text},
                                                            {"binary_little_endian", Encoding::little_endian},
                                                            {"binary_big_endian", Encoding::big_endian}};
    const auto found = kEncodings.find(name);
    if (found == kEncodings.end())
      return fmt::format("unknown format {}; export the map as binary_little_endian", name);
    builder.layout.encoding = found->second;
    return std::nullopt;
  }

  Problem take_element(const Words& words) {
    in_vertex_ = words[1] == "vertex";
    if (in_vertex_ && elements_ > 0)
      return "the element vertex is not the first; export the points alone";
    ++elements_;
    if (in_vertex_ && !parse(words[2], builder.layout.points))
      return fmt::format("{} is no number of points; export the map again", words[2]);
    return std::nullopt;
  }

  Problem take_property(const Words& words) {
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

class PcdHeader {
 public:
  LayoutBuilder builder;

  /// Takes a line in; `ended` at the last of the header.
  Problem take(const Words& words, bool& ended) {
    if (words.empty() || words[0].starts_with('#'))
      return std::nullopt;
    const std::string& key = words[0];
    const Words values{words.begin() + 1, words.end()};
    if (key == "DATA" && values.size() == 1) {
      ended = true;
      return finish(values[0]);
    }
    if (key == "POINTS" && (values.size() != 1 || !parse(values[0], builder.layout.points)))
      return "POINTS is no number; export the map again";
    if (key == "VERSION" || key == "WIDTH" || key == "HEIGHT" || key == "VIEWPOINT" || key == "POINTS")
      return std::nullopt;
    if (key == "FIELDS" || key == "SIZE" || key == "TYPE" || key == "COUNT") {
      lines_[key] = values;
      return std::nullopt;
    }
    return "not a line of a PCD header; export the map again";
  }

 private:
  Problem finish(const std::string& encoding) {
    if (encoding != "ascii" && encoding != "binary")
      return fmt::format("DATA {} cannot be read in parts; convert the map to DATA binary", encoding);
    builder.layout.encoding = encoding == "ascii" ? Encoding::text : Encoding::little_endian;
    const Words& names = lines_["FIELDS"];
    lines_.try_emplace("COUNT", names.size(), "1");
    for (const char* key : {"SIZE", "TYPE", "COUNT"}) {
      if (lines_[key].size() != names.size())
        return fmt::format("{} does not have as many values as FIELDS; export the map again", key);
    }
    for (std::size_t i = 0; i < names.size(); ++i) {
      constexpr std::size_t kMost = 100'000; // of numbers in a field, a histogram for example
      std::size_t bytes = 0, count = 0;
      if (!parse(lines_["SIZE"][i], bytes) || !parse(lines_["COUNT"][i], count) || bytes > 8 || count > kMost)
        return fmt::format("SIZE or COUNT of {} is no sensible number; export the map again", names[i]);
      if (Problem problem = builder.add(names[i], bytes, lines_["TYPE"][i] == "F", count))
        return problem;
    }
    return builder.missing();
  }

  std::map<std::string, Words> lines_;
};

template <class Header> Expected<PointCloudLayout, std::string> read_header(std::istream& stream, Words first) {
  Header header;
  bool ended = false;
  std::uint64_t number = 1;
  for (Words words = std::move(first); true; ++number) {
    if (Problem problem = header.take(words, ended))
      return fmt::format("{}: {}", number, *problem);
    if (ended)
      break;
    const std::optional<std::string> line = read_short_line(stream);
    if (!line)
      return fmt::format("{}: the header does not end; export the map again", number + 1);
    words = words_of(*line);
  }
  header.builder.layout.header_lines = number;
  return header.builder.layout;
}

} // namespace

std::optional<std::string> read_short_line(std::istream& stream) {
  constexpr std::size_t kLongest = 4096;
  std::string line(kLongest, '\0');
  if (!stream.getline(line.data(), kLongest))
    return std::nullopt;
  line.resize(std::string_view{line.c_str()}.size());
  return line;
}

Expected<PointCloudLayout, std::string> PointCloudLayout::read(std::istream& stream) {
  Words first = words_of(read_short_line(stream).value_or(""));
  if (!first.empty() && first[0] == "ply")
    return read_header<PlyHeader>(stream, std::move(first));
  if (!first.empty() && (first[0] == "VERSION" || (first.size() > 1 && first[0] == "#" && first[1] == ".PCD")))
    return read_header<PcdHeader>(stream, std::move(first));
  return fmt::format("1: {}", kNotACloud);
}

} // namespace locus
