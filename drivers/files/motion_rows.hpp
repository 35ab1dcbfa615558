// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <istream>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "core/sources/motion_sample.hpp"

/// Row parsers of recorded motion; internal to motion_files.cpp.
namespace locus {

using Fields = std::span<const std::string_view>;
using Problem = std::optional<std::string>; ///< what is wrong with a line, and what to do; empty if nothing

/// Row of a meta file.
struct Meta {
  Stamp stamp;
  Stamp arrival;
  double covariance_scale = 1.0;
};

/// Parses a decimal number in units of 10^unit_exponent seconds since 1970, rounded to nanoseconds. Avoids double,
/// whose resolution is 200 ns at today's dates. Accepts an exponent: NumPy writes 1.403636579763555527e+09.
std::optional<Stamp> parse_time(std::string_view text, int unit_exponent);

/// Returns a rotation, NaN included; bits are preserved if the length is 1 up to rounding. Empty if the length deviates
/// by more than 5 %, which distinguishes columns in another order from rounding by the writer.
std::optional<Eigen::Quaterniond> unit_quaternion(double w, double x, double y, double z);

Problem parse_imu(Fields fields, ImuSample& sample);
Problem parse_odometry(Fields fields, OdometrySample& sample);
Problem parse_meta(Fields fields, Meta& meta);

/// Removes surrounding blanks.
std::string_view trimmed(std::string_view text);

/// Returns true if no field is a number, as in a header line.
bool is_header(Fields fields);

/// Splits a line at commas, or at runs of blanks for the separator ' '. A line with too many fields yields kMaxFields +
/// 1 fields, which no format has.
class FieldSplitter {
 public:
  static constexpr std::size_t kMaxFields = 11;

  explicit FieldSplitter(char separator) : separator_(separator) {}

  Fields operator()(std::string_view line) {
    std::size_t count = 0;
    while (count < fields_.size()) {
      const std::size_t end = separator_ == ' ' ? line.find_first_of(" \t") : line.find(separator_);
      fields_[count++] = trimmed(line.substr(0, end));
      if (end == std::string_view::npos) {
        break;
      }
      line = separator_ == ' ' ? trimmed(line.substr(end)) : line.substr(end + 1);
    }
    return {fields_.data(), count};
  }

 private:
  char separator_;
  std::array<std::string_view, kMaxFields + 1> fields_;
};

/// Reads the rows of a table in sequence. Skips blank lines, comments and a header line.
template <class Row> class RowReader {
 public:
  RowReader(const std::filesystem::path& file, char separator, Problem (*parse_row)(Fields, Row&))
      : RowReader(std::make_unique<std::ifstream>(file), file.string(), separator, parse_row) {
    if (!*stream_ || std::filesystem::is_directory(file)) {
      problem_ = fmt::format("{}: cannot be read; check the path and its permissions", name_);
    }
  }

  /// Reads from any stream; `name` stands for it in errors.
  RowReader(std::unique_ptr<std::istream> stream, std::string name, char separator, Problem (*parse_row)(Fields, Row&))
      : stream_(std::move(stream)), name_(std::move(name)), split_(separator), parse_row_(parse_row) {}

  /// Returns false at the end and on a problem.
  bool next(Row& row) {
    while (!problem_ && std::getline(*stream_, buffer_)) {
      ++line_;
      const std::string_view line = trimmed(buffer_);
      if (line.empty() || line.starts_with('#')) {
        continue;
      }
      const Fields fields = split_(line);
      if (std::exchange(first_, false) && is_header(fields)) {
        continue;
      }
      row = {};
      if (const Problem problem = parse_row_(fields, row)) {
        report(*problem);
      }
      return !problem_;
    }
    return false;
  }

  /// Records a problem, prefixed with the position of the latest row.
  void report(const std::string& problem) { problem_ = fmt::format("{}:{}: {}", name_, line_, problem); }
  [[nodiscard]] const Problem& problem() const { return problem_; }
  /// Returns true if the problem is in an incomplete last line.
  [[nodiscard]] bool breaks_off() const { return problem_ && stream_->eof(); }

 private:
  std::unique_ptr<std::istream> stream_;
  std::string name_;
  FieldSplitter split_;
  Problem (*parse_row_)(Fields, Row&);
  std::string buffer_;
  std::size_t line_ = 0;
  bool first_ = true;
  Problem problem_;
};

} // namespace locus
