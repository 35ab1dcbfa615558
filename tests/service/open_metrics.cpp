// SPDX-License-Identifier: Apache-2.0
#include "service/open_metrics.hpp"

#include <cmath>
#include <limits>
#include <optional>
#include <regex>
#include <set>
#include <sstream>

#include <gtest/gtest.h>

namespace locus::test {
namespace {

const std::regex kMetadata{R"(# (TYPE|UNIT|HELP) ([a-zA-Z_:][a-zA-Z0-9_:]*) (.+))"};
const std::regex kSample{R"(([a-zA-Z_:][a-zA-Z0-9_:]*)(\{(.*)\})? ([^ ]+))"};
const std::regex kLabel{R"re(([a-zA-Z_][a-zA-Z0-9_]*)="((?:[^"\\\n]|\\["\\n])*)"(,|$))re"};
const std::regex kNumber{R"([+-]?([0-9]+(\.[0-9]*)?([eE][+-]?[0-9]+)?|Inf)|NaN)"};

const std::map<std::string, std::set<std::string>> kSuffixes{{"counter", {"_total", "_created"}},
                                                             {"gauge", {""}},
                                                             {"info", {"_info"}},
                                                             {"stateset", {""}},
                                                             {"histogram", {"_bucket", "_sum", "_count", "_created"}}};

class Parser {
 public:
  OpenMetrics parse(const std::string& text) {
    if (!text.ends_with("\n# EOF\n"))
      blame("the text does not end with # EOF", "");
    std::istringstream lines(text);
    bool has_ended = false;
    for (std::string line; std::getline(lines, line);) {
      if (has_ended)
        blame("after the end", line);
      has_ended = line == "# EOF";
      if (!has_ended)
        take(line);
    }
    end_family();
    return std::move(found_);
  }

 private:
  void blame(const std::string& what, const std::string& line) { found_.mistakes.push_back(what + ": " + line); }

  void take(const std::string& line) {
    std::smatch parts;
    if (std::regex_match(line, parts, kMetadata))
      take_metadata(parts[1], parts[2], parts[3], line);
    else if (std::regex_match(line, parts, kSample))
      take_sample(parts[1], parts[3], parts[4], line);
    else
      blame("neither metadata nor sample", line);
  }

  void take_metadata(const std::string& what, const std::string& name, const std::string& text,
                     const std::string& line) {
    if (name != family_) {
      end_family();
      family_ = name;
      if (!families_.insert(name).second)
        blame("a family in two places", line);
    } else if (has_samples_) {
      blame("metadata after samples", line);
    }
    if (!told_.insert(what).second)
      blame("metadata twice", line);
    if (what == "TYPE") {
      type_ = found_.types[name] = text;
      if (!kSuffixes.contains(text))
        blame("unknown type", line);
    }
    if (what == "UNIT" && (!name.ends_with('_' + text) || type_ == "info" || type_ == "stateset"))
      blame("a unit that is not the end of the name, or of a type that has none", line);
  }

  std::optional<OpenMetrics::Labels> labels_of(std::string text) {
    OpenMetrics::Labels labels;
    for (std::smatch parts; !text.empty(); text = parts.suffix()) {
      if (!std::regex_search(text, parts, kLabel, std::regex_constants::match_continuous) ||
          !labels.emplace(parts[1], parts[2]).second || (parts[3] == "," && parts.suffix().length() == 0))
        return std::nullopt;
    }
    return labels;
  }

  void take_sample(const std::string& name, const std::string& inside, const std::string& number,
                   const std::string& line) {
    has_samples_ = true;
    const auto labels = labels_of(inside);
    if (!labels || !std::regex_match(number, kNumber))
      return blame("labels or number", line);
    const double value = number == "NaN" ? std::numeric_limits<double>::quiet_NaN() : std::stod(number);
    const bool belongs = name.starts_with(family_) && kSuffixes.contains(type_) &&
                         kSuffixes.at(type_).contains(name.substr(family_.size()));
    if (!belongs || told_.count("HELP") == 0)
      blame("not of the family before it, or without help", line);
    if (!found_.samples[name].emplace(*labels, value).second)
      blame("a sample twice", line);
    if ((type_ == "counter" || type_ == "histogram") && !(value >= 0 && std::isfinite(value)))
      blame("a count that is none", line);
    if (type_ == "info" && value != 1)
      blame("an info that is not 1", line);
    if (type_ == "stateset" && (!labels->contains(family_) || (value != 0 && value != 1)))
      blame("a state without its label, or neither 0 nor 1", line);
    if (labels->contains("le") != name.ends_with("_bucket"))
      blame("le belongs to buckets", line);
    if (name.ends_with("_bucket"))
      take_bucket(labels->contains("le") ? labels->at("le") : "", value, line);
    if (type_ == "histogram" && name.ends_with("_count") &&
        (bound_ != std::numeric_limits<double>::infinity() || value != count_))
      blame("the count is not that of the bucket +Inf", line);
  }

  /// Canonical form: every finite bound has a decimal point.
  void take_bucket(const std::string& le, double count, const std::string& line) {
    const double bound = le == "+Inf" ? std::numeric_limits<double>::infinity() : std::stod(le);
    if ((le != "+Inf" && le.find('.') == std::string::npos) || bound <= bound_ || count < count_)
      blame("bounds or counts of buckets do not grow, or a bound is not canonical", line);
    bound_ = bound;
    count_ = count;
  }

  void end_family() {
    if (!family_.empty() && (!has_samples_ || type_.empty()))
      blame("a family without samples or type", family_);
    if (type_ == "histogram" &&
        (!found_.samples.contains(family_ + "_sum") || !found_.samples.contains(family_ + "_count")))
      blame("a histogram without sum or count", family_);
    family_.clear();
    type_.clear();
    told_.clear();
    has_samples_ = false;
    bound_ = -std::numeric_limits<double>::infinity();
    count_ = 0;
  }

  OpenMetrics found_;
  std::string family_, type_;
  std::set<std::string> told_, families_;
  bool has_samples_ = false;
  double bound_ = -std::numeric_limits<double>::infinity(), count_ = 0;
};

} // namespace

OpenMetrics OpenMetrics::parse(const std::string& text) { return Parser{}.parse(text); }

double OpenMetrics::value(const std::string& name, const Labels& labels) const {
  const auto family = samples.find(name);
  if (family != samples.end())
    if (const auto sample = family->second.find(labels); sample != family->second.end())
      return sample->second;
  ADD_FAILURE() << "no sample " << name << ' ' << testing::PrintToString(labels);
  return std::numeric_limits<double>::quiet_NaN();
}

} // namespace locus::test
