// SPDX-License-Identifier: Apache-2.0
#include "config/config_yaml.hpp"

#include <fmt/format.h>
#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cctype>
#include <fstream>
#include <map>
#include <span>
#include <sstream>

#include "config/config_fields.hpp"
#include "config/mistyped.hpp"
#include "config/sha256.hpp"
#include "config/yaml_values.hpp"

namespace locus {
namespace {

struct Mistake {
  std::string path; ///< "lidars.0.port"; empty: the whole file
  int line = 0;     ///< starts at 1
  std::string what;
};

std::string join(const std::string& path, std::string_view key) {
  return path.empty() ? std::string{key} : path + '.' + std::string{key};
}

std::vector<std::string> split(std::string_view text, char separator) {
  std::vector<std::string> parts{""};
  for (const char c : text)
    c == separator ? void(parts.emplace_back()) : parts.back().push_back(c);
  return parts;
}

std::string unknown_key(std::string_view key, const std::vector<std::string_view>& known) {
  return fmt::format("unknown key; the nearest known one is '{}'", nearest_word(key, known));
}

struct AnySection;
template <class T>
concept HasFields = requires(T& value, AnySection& section) {
  fields(section, value);
};

/// Tells whether `path` is `outer` or lies below it.
bool contains(const std::string& outer, const std::string& path) { return (path + '.').starts_with(outer + '.'); }

/// Tells whether `path` or a section around it could not be read.
bool is_blamed(const std::vector<Mistake>& unreadable, const std::string& path) {
  return std::any_of(unreadable.begin(), unreadable.end(), [&](const Mistake& m) { return contains(m.path, path); });
}

/// Returns the key of a line of problem().
std::string path_of(const std::string& problem) { return problem.substr(0, problem.find(": ")); }

/// Reads a YAML tree into structs and stores the line of every key.
class Reading {
 public:
  /// Reads a section with fields() into `value`; fields without a key stay unchanged.
  template <class T> void read_section(const YAML::Node& node, const std::string& path, int line, T& value);

  template <class T> void read(const YAML::Node& node, const std::string& path, int line, T& value) {
    lines_[path] = line;
    if constexpr (HasFields<T>)
      read_section(node, path, line, value);
    else if (const auto reason = parse(node, value))
      blame(path, line, *reason);
  }
  template <class T> void read(const YAML::Node& node, const std::string& path, int line, std::vector<T>& items) {
    lines_[path] = line;
    if (!node.IsSequence())
      return blame(path, line, "must be a list");
    items.assign(node.size(), T{});
    for (std::size_t i = 0; i < items.size(); ++i)
      read(node[i], join(path, std::to_string(i)), node[i].Mark().line + 1, items[i]);
  }

  void blame(const std::string& path, int line, std::string what) {
    mistakes_.push_back({path, line, std::move(what)});
  }

  /// Maps each line of a problem() to the line of its key in the file, or of the nearest section around it. Skips keys
  /// that could not be read, as they are already reported.
  void blame_problems(const std::optional<std::string>& problems);

  [[nodiscard]] std::vector<Mistake> release_mistakes() {
    std::stable_sort(mistakes_.begin(), mistakes_.end(), [](const auto& a, const auto& b) { return a.line < b.line; });
    return std::move(mistakes_);
  }

 private:
  std::map<std::string, int> lines_;
  std::vector<Mistake> mistakes_;
};

/// Section passed to fields() by the reader.
class SectionReader {
 public:
  SectionReader(Reading& reading, const YAML::Node& node, std::string path, int line)
      : reading_(reading), path_(std::move(path)) {
    if (!node.IsMap() && !node.IsNull()) // null: a section without keys
      reading_.blame(path_, line, "must be a section of keys");
    else
      for (const auto& entry : node)
        add(entry.first, entry.second);
  }

  template <class T> void key(std::string_view name, T& value) {
    known_.push_back(name);
    if (const auto entry = entries_.find(name); entry != entries_.end())
      reading_.read(entry->second.value, join(path_, name), entry->second.line, value);
  }
  template <class T> void key_or(std::string_view name, std::optional<T>& value, std::string_view word_for_none) {
    OptionalWord<T> word{value, word_for_none};
    key(name, word);
  }

  [[nodiscard]] bool has(std::string_view name) const { return entries_.contains(name); }

  void blame_unknown_keys() {
    for (const auto& [name, entry] : entries_) {
      if (std::find(known_.begin(), known_.end(), name) == known_.end())
        reading_.blame(join(path_, name), entry.line, unknown_key(name, known_));
    }
  }

 private:
  struct Entry {
    YAML::Node value;
    int line;
  };

  void add(const YAML::Node& key, const YAML::Node& value) {
    const int line = key.Mark().line + 1;
    if (!key.IsScalar())
      reading_.blame(path_, line, "a key must be a word");
    else if (const auto [entry, is_new] = entries_.try_emplace(key.Scalar(), Entry{value, line}); !is_new)
      reading_.blame(join(path_, key.Scalar()), line,
                     "is repeated, first in line " + std::to_string(entry->second.line));
  }

  Reading& reading_;
  std::string path_;
  std::map<std::string, Entry, std::less<>> entries_;
  std::vector<std::string_view> known_;
};

template <class T> void Reading::read_section(const YAML::Node& node, const std::string& path, int line, T& value) {
  SectionReader section{*this, node, path, line};
  fields(section, value);
  section.blame_unknown_keys();
}

void Reading::blame_problems(const std::optional<std::string>& problems) {
  if (!problems)
    return;
  const std::vector<Mistake> unreadable = mistakes_;
  for (const std::string& problem : split(*problems, '\n')) {
    const std::string path = path_of(problem);
    std::string known = path;
    while (!known.empty() && !lines_.contains(known))
      known.resize(known.find('.') == std::string::npos ? 0 : known.rfind('.'));
    const int line = known.empty() ? 1 : lines_.at(known);
    if (!is_blamed(unreadable, path))
      blame(path, line, problem.substr(path.size() + 2));
  }
}

/// Section passed to fields() by the writer.
class SectionWriter {
 public:
  template <class T> void key(std::string_view name, T& value) { node_.force_insert(std::string{name}, write(value)); }
  template <class T> void key_or(std::string_view name, std::optional<T>& value, std::string_view word_for_none) {
    OptionalWord<T> word{value, word_for_none};
    key(name, word);
  }
  [[nodiscard]] static bool has(std::string_view /*name*/) { return true; }
  [[nodiscard]] YAML::Node node() const { return node_; }

  template <class T> static YAML::Node write(T& value) {
    if constexpr (!HasFields<T>) {
      return to_node(value);
    } else {
      SectionWriter section;
      fields(section, value);
      section.node_.SetStyle(YAML::EmitterStyle::Flow);
      return section.node_;
    }
  }
  template <class T> static YAML::Node write(std::vector<T>& items) {
    YAML::Node node{YAML::NodeType::Sequence};
    for (T& item : items)
      node.push_back(write(item));
    if (!HasFields<T> || items.empty())
      node.SetStyle(YAML::EmitterStyle::Flow);
    return node;
  }

 private:
  YAML::Node node_{YAML::NodeType::Map};
};

YAML::Node to_tree(Config config) {
  SectionWriter section;
  fields(section, config);
  return section.node();
}

std::string text_of(const Mistake& mistake) {
  return mistake.path.empty() ? mistake.what : mistake.path + ": " + mistake.what;
}

/// One --set option and its path in the tree.
struct Override {
  std::string assignment;
  std::string path; ///< with list items by index
};

/// Finds a list item by its index or its name.
std::optional<std::size_t> find_item(const YAML::Node& list, const std::string& name_or_index) {
  for (std::size_t i = 0; i < list.size(); ++i)
    if (name_or_index == std::to_string(i) || (list[i].IsMap() && list[i]["name"].as<std::string>("") == name_or_index))
      return i;
  return std::nullopt;
}

/// Descends from `node` along one part of a dotted path. Returns the mistake, if any.
std::optional<std::string> descend(YAML::Node& node, std::string& path, const std::string& part) {
  if (node.IsMap()) {
    std::vector<std::string_view> keys;
    for (const auto& entry : node)
      keys.push_back(entry.first.Scalar());
    if (std::find(keys.begin(), keys.end(), part) == keys.end())
      return join(path, part) + ": " + unknown_key(part, keys);
    path = join(path, part);
    node.reset(node[part]);
    return std::nullopt;
  }
  if (node.IsSequence()) {
    const auto index = find_item(node, part);
    if (!index)
      return path + " has no item '" + part + "'; use a name or an index below " + std::to_string(node.size());
    path = join(path, std::to_string(*index));
    node.reset(node[*index]);
    return std::nullopt;
  }
  return path + " has no keys below it";
}

/// Stores the value of one --set option in the tree. Returns the mistake, if any.
std::optional<std::string> assign(const YAML::Node& tree, Override& override) {
  const std::size_t equals = override.assignment.find('=');
  if (equals == std::string::npos || equals == 0)
    return "must be KEY=VALUE, e.g. lidars.front.port=2369";
  YAML::Node node = tree;
  for (const std::string& part : split(override.assignment.substr(0, equals), '.'))
    if (auto problem = descend(node, override.path, part))
      return problem;
  try {
    node = YAML::Load(override.assignment.substr(equals + 1));
  } catch (const std::exception&) {
    return "the value is not YAML";
  }
  return std::nullopt;
}

/// Returns the option that violates the rule of a key: the last one that set the key or a key below or around it.
const Override& culprit(const std::vector<Override>& overrides, const std::string& path) {
  const auto related = std::find_if(overrides.rbegin(), overrides.rend(), [&](const Override& override) {
    return contains(override.path, path) || contains(path, override.path);
  });
  return related == overrides.rend() ? overrides.back() : *related;
}

/// Formats one line for the terminal, with control characters of the file replaced.
std::string error_line(const std::string& where, const std::string& what) {
  std::string line = where + ": " + what;
  std::replace_if(
      line.begin(), line.end(), [](unsigned char c) { return std::iscntrl(c) != 0; }, '?');
  return line;
}

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
  const std::vector<std::string> lines = split(yaml, '\n');
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
  Reading reading;
  reading.read_section(document, "", 1, config);
  reading.blame_problems(config.problem());
  ConfigErrors errors;
  for (const Mistake& mistake : reading.release_mistakes())
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
        error_line(at_line(file.string(), static_cast<int>(split(*text, '\n').size())),
                   fmt::format("ends within a line after {} bytes, as an interrupted write does: restore "
                               "the rest, or end this line with a line break if nothing is missing",
                               text->size()))};
  return config;
}

bool sets_key(const std::filesystem::path& file, const std::string& path) {
  YAML::Node node = YAML::LoadFile(file.string());
  std::string known;
  const std::vector<std::string> parts = split(path, '.');
  return std::all_of(parts.begin(), parts.end(),
                     [&](const std::string& part) { return !descend(node, known, part).has_value(); });
}

Expected<Config, ConfigErrors> override_config(const Config& config, std::span<const std::string> assignments) {
  Config changed = config;
  std::vector<Override> overrides;
  std::vector<Mistake> unreadable;
  ConfigErrors errors;
  const auto blame = [&](const Override& override, const std::string& what) {
    errors.push_back(error_line("--set " + override.assignment, what));
  };
  for (const std::string& assignment : assignments) {
    Override& override = overrides.emplace_back(Override{assignment, ""});
    const YAML::Node tree = to_tree(changed);
    Reading reading;
    if (const auto problem = assign(tree, override))
      blame(override, *problem);
    else
      reading.read_section(tree, "", 1, changed);
    for (Mistake& mistake : reading.release_mistakes()) {
      blame(override, text_of(mistake));
      unreadable.push_back(std::move(mistake));
    }
  }
  const auto problems = changed.problem();
  if (problems && !overrides.empty())
    for (const std::string& problem : split(*problems, '\n'))
      if (!is_blamed(unreadable, path_of(problem)))
        blame(culprit(overrides, path_of(problem)), problem);
  if (!errors.empty())
    return errors;
  return changed;
}

std::string print_config(const Config& config) {
  YAML::Emitter emitter;
  emitter << to_tree(config);
  return std::string{emitter.c_str(), emitter.size()} + '\n';
}

Pose as_written(Pose pose) {
  SectionWriter unused;
  fields(unused, pose);
  return pose;
}

std::string config_sha256(const Config& config) {
  const std::string text = print_config(config);
  Sha256 digest;
  digest.add(std::as_bytes(std::span(text)));
  return digest.hex();
}

} // namespace locus
