// SPDX-License-Identifier: Apache-2.0
#include "accuracy/pcd_header.hpp"

#include <algorithm>
#include <charconv>
#include <limits>
#include <map>
#include <sstream>
#include <string_view>
#include <utility>

#include <fmt/format.h>

namespace locus {
namespace {

using PcdProblem = std::optional<std::string>;

template <class Number> bool parse_pcd(const std::string& text, Number& number) {
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, number);
  return error == std::errc{} && stop == end;
}

/// Parses a header line by line.
class PcdHeaderLines {
 public:
  PcdHeader header;

  /// Parses one line; sets `ended` at the last of the header.
  PcdProblem read_line(const std::string& line, bool& ended) {
    std::vector<std::string> words = words_of(line);
    if (words.empty() || words[0].starts_with('#'))
      return std::nullopt;
    const std::string key = words[0];
    words.erase(words.begin());
    if (key == "DATA" && words.size() == 1) {
      ended = true;
      return finish(words[0]);
    }
    if (key == "VERSION" || key == "VIEWPOINT")
      return std::nullopt;
    if (key == "WIDTH" || key == "HEIGHT" || key == "POINTS")
      return read_number(key, words);
    if (key == "FIELDS" || key == "SIZE" || key == "TYPE" || key == "COUNT") {
      lines_[key] = words;
      return std::nullopt;
    }
    return "not a line of a PCD header; export it again";
  }

 private:
  PcdProblem read_number(const std::string& key, const std::vector<std::string>& values) {
    std::uint64_t& number = key == "WIDTH" ? header.width : key == "HEIGHT" ? header.height : header.points;
    if (values.size() != 1 || !parse_pcd(values[0], number))
      return fmt::format("{} is not a number; export it again", key);
    return std::nullopt;
  }

  PcdProblem finish(const std::string& data) {
    if (data != "ascii" && data != "binary" && data != "binary_compressed")
      return fmt::format("unknown DATA {}; export it as binary", data);
    header.data = data == "ascii"    ? PcdHeader::Data::ascii
                  : data == "binary" ? PcdHeader::Data::binary
                                     : PcdHeader::Data::binary_compressed;
    const std::vector<std::string>& names = lines_["FIELDS"];
    lines_.try_emplace("COUNT", names.size(), "1");
    for (const char* key : {"SIZE", "TYPE", "COUNT"}) {
      if (lines_[key].size() != names.size())
        return fmt::format("{} does not have as many values as FIELDS; export it again", key);
    }
    for (std::size_t i = 0; i < names.size(); ++i) {
      constexpr std::size_t kMost = 100'000; // numbers in a field, such as a histogram
      PcdHeader::Field field{names[i], lines_["TYPE"][i][0], 0, 0};
      if (!parse_pcd(lines_["SIZE"][i], field.bytes) || !parse_pcd(lines_["COUNT"][i], field.count) ||
          field.bytes > 8 || field.count > kMost)
        return fmt::format("SIZE or COUNT of {} is not a sensible number; export it again", names[i]);
      header.fields.push_back(std::move(field));
    }
    return std::nullopt;
  }

  std::map<std::string, std::vector<std::string>> lines_;
};

} // namespace

std::vector<std::string> words_of(const std::string& line) {
  std::istringstream stream{line};
  std::vector<std::string> words;
  for (std::string word; stream >> word;)
    words.push_back(word);
  return words;
}

std::optional<std::string> read_short_line(std::istream& stream) {
  constexpr std::size_t kLongest = 4096;
  std::string line(kLongest, '\0');
  if (!stream.getline(line.data(), kLongest))
    return std::nullopt;
  line.resize(std::string_view{line.c_str()}.size());
  return line;
}

std::size_t PcdHeader::record_bytes() const {
  std::size_t bytes = 0;
  for (const Field& field : fields)
    bytes += field.bytes * field.count;
  return bytes;
}

bool PcdHeader::begins_with(const std::string& line) {
  const std::vector<std::string> words = words_of(line);
  return !words.empty() && (words[0] == "VERSION" || (words.size() > 1 && words[0] == "#" && words[1] == ".PCD"));
}

Expected<PcdHeader, std::string> PcdHeader::read(std::istream& stream) {
  PcdHeaderLines lines;
  bool ended = false;
  for (std::uint64_t number = 1; !ended; ++number) {
    const std::optional<std::string> line = read_short_line(stream);
    if (number == 1 && !begins_with(line.value_or("")))
      return std::string{"1: not a PCD file; export it as one"};
    if (!line)
      return fmt::format("{}: the header does not end; export it again", number);
    if (PcdProblem problem = lines.read_line(*line, ended))
      return fmt::format("{}: {}", number, *problem);
    lines.header.lines = number;
  }
  PcdHeader& header = lines.header;
  constexpr std::uint64_t kMost = std::numeric_limits<std::uint32_t>::max();
  if (header.points == 0 && header.width <= kMost && header.height <= kMost)
    header.points = header.width * header.height;
  return header;
}

} // namespace locus
