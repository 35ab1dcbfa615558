// SPDX-License-Identifier: Apache-2.0
#include "config/config_yaml.hpp"

#include <fmt/format.h>
#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/yaml.h>

#include <fstream>
#include <map>
#include <sstream>

#include "config/config_mistakes.hpp"
#include "config/config_tree.hpp"

namespace locus {
namespace {

std::string at_line(const std::string& file, int line) { return file + ':' + std::to_string(line); }

/// Translates the library's messages about invalid YAML for users who do not know the grammar.
std::string in_plain_words(const std::string& complaint, const std::string& yaml, int line) {
  static constexpr std::string_view kIndentation = "this line is not indented like the lines it belongs to; indent all "
                                                   "keys of a section, and all items of a list, by the same "
                                                   "number of spaces";
  static const std::map<std::string_view, std::string_view> kWords{
      {"end of map not found", kIndentation},
      {"end of sequence not found", kIndentation},
      {"illegal map value",
       "a key is not possible here; check this line and the one before for a missing colon or space "
       "after it, and for an indentation unlike that of the other keys"},
      {"end of map flow not found", "a { before this line is not closed; add the missing }"},
      {"end of sequence flow not found", "a [ before this line is not closed; add the missing ]"},
      {"unknown token", "no value begins like this; quote it"}};
  const std::vector<std::string> lines = split_at(yaml, '\n');
  const auto index = static_cast<std::size_t>(line - 1);
  if (index < lines.size() &&
      lines[index].substr(0, lines[index].find_first_not_of(" \t")).find('\t') != std::string::npos)
    return "this line is indented by a tab; use spaces";
  const auto known = kWords.find(complaint);
  return known == kWords.end() ? "not YAML: " + complaint : std::string{known->second};
}

/// Records where the documents of a text begin.
class DocumentStart : public YAML::EventHandler {
 public:
  YAML::Mark latest;

  void OnDocumentStart(const YAML::Mark& mark) override { latest = mark; }
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark&, YAML::anchor_t) override {}
  void OnAlias(const YAML::Mark&, YAML::anchor_t) override {}
  void OnScalar(const YAML::Mark&, const std::string&, YAML::anchor_t, const std::string&) override {}
  void OnSequenceStart(const YAML::Mark&, const std::string&, YAML::anchor_t, YAML::EmitterStyle::value) override {}
  void OnSequenceEnd() override {}
  void OnMapStart(const YAML::Mark&, const std::string&, YAML::anchor_t, YAML::EmitterStyle::value) override {}
  void OnMapEnd() override {}
};

/// Reports a second document. YAML::LoadAll() is unsuitable: a leading comma makes it create empty documents forever.
std::optional<Mistake> second_document(const std::string& yaml) {
  std::istringstream stream{yaml};
  YAML::Parser parser{stream};
  DocumentStart start;
  if (!parser.HandleNextDocument(start))
    return std::nullopt;
  const YAML::Mark first = start.latest;
  if (!parser.HandleNextDocument(start))
    return std::nullopt;
  return Mistake{"", start.latest.line + 1,
                 start.latest.pos == first.pos
                     ? "no key begins like this; remove what precedes it"
                     : "a second YAML document begins; keep one, and begin every top-level key in the first column"};
}

Expected<std::string, ConfigErrors> text_of(const std::filesystem::path& file) {
  constexpr std::streamsize kMaxBytes = 1 << 20;
  std::string text(kMaxBytes + 1, '\0');
  std::ifstream stream{file, std::ios::binary};
  stream.read(text.data(), static_cast<std::streamsize>(text.size()));
  if (stream.bad() || (stream.gcount() == 0 && !stream.eof()))
    return ConfigErrors{error_line(file.string(), "cannot be read; name a YAML file that exists and is readable")};
  if (stream.gcount() > kMaxBytes)
    return ConfigErrors{error_line(file.string(), "is longer than 1 MiB; this is not a configuration")};
  text.resize(static_cast<std::size_t>(stream.gcount()));
  return text;
}

/// Recognises a file that was cut while it was written, on a full disk or by a crash. What follows would have its
/// defaults, and DDS would move to the loopback interface. Such a write ends at a boundary of pages; a complete file
/// without a line break at its end, which editors may leave out, does so once in thousands.
bool is_cut(std::string_view text) {
  constexpr std::size_t kPage = 4096;
  return text.size() % kPage == 0 && !text.ends_with('\n');
}

} // namespace

Expected<Config, ConfigErrors> parse_config(const std::string& yaml, const std::string& origin) {
  YAML::Node document;
  std::optional<Mistake> second;
  try {
    second = second_document(yaml);
    document = YAML::Load(yaml);
  } catch (const YAML::Exception& error) {
    const int line = error.mark.line + 1;
    return ConfigErrors{error_line(at_line(origin, line), in_plain_words(error.msg, yaml, line))};
  } catch (const std::exception& error) {
    return ConfigErrors{error_line(at_line(origin, 1), std::string{"not YAML: "} + error.what())};
  }
  if (second)
    return ConfigErrors{error_line(at_line(origin, second->line), second->what)};
  Config config;
  ConfigErrors errors;
  for (const Mistake& mistake : read_and_check(document, config))
    errors.push_back(error_line(at_line(origin, mistake.line), text_of(mistake)));
  if (!errors.empty())
    return errors;
  return config;
}

Expected<Config, ConfigErrors> load_config(const std::filesystem::path& file) {
  const auto text = text_of(file);
  return text ? parse_config(*text, file.string()) : text.error();
}

Expected<Config, ConfigErrors> load_service_config(const std::filesystem::path& file) {
  const auto text = text_of(file);
  if (!text)
    return text.error();
  Expected<Config, ConfigErrors> config = parse_config(*text, file.string());
  if (config && !config->defaults && !YAML::Load(*text)["lidars"])
    return ConfigErrors{
        error_line(at_line(file.string(), 1),
                   "names no lidar (is the file cut short?); name those of the robot under lidars:, or write "
                   "'defaults: true' for one VLP-16 in the middle of the robot")};
  if (config && is_cut(*text))
    return ConfigErrors{
        error_line(at_line(file.string(), static_cast<int>(split_at(*text, '\n').size())),
                   fmt::format("ends within a line after {} bytes, as an interrupted write does: restore "
                               "the rest, or end this line with a line break if nothing is missing",
                               text->size()))};
  return config;
}

} // namespace locus
