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

/// The rows of recorded motion, text by text; for motion_files.cpp.
namespace locus {

using Fields = std::span<const std::string_view>;
using Problem = std::optional<std::string>; ///< what is wrong with a line, and what to do

/// What a meta file says of a sample.
struct Meta {
  Stamp stamp;
  Stamp arrival;
  double covariance_scale = 1.0;
};

/// A decimal number of units of 10^unit_exponent seconds since 1970, rounded to nanoseconds without a detour over
/// double, whose steps are 200 ns at today's dates. Takes an exponent too: NumPy writes 1.403636579763555527e+09.
std::optional<Stamp> parse_time(std::string_view text, int unit_exponent);

/// A rotation, NaN included; one of unit length up to rounding keeps its bits. Nothing when the four numbers are none,
/// which tells columns in another order from a quaternion rounded by the writer.
std::optional<Eigen::Quaterniond> unit_quaternion(double w, double x, double y, double z);

Problem parse_imu(Fields fields, ImuSample& sample);
Problem parse_odometry(Fields fields, OdometrySample& sample);
Problem parse_meta(Fields fields, Meta& meta);

/// Without the blanks around it.
std::string_view trimmed(std::string_view text);

/// A first line in which nothing is a number.
bool is_header(Fields fields);

/// Splits at commas, or at runs of blanks for the separator ' '. A line with more fields than fit is returned with one
/// more than kMaxFields, which no format has.
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

/// The rows of a table, one after the other. Blank lines, comments and a header line are none.
template <class Row> class RowReader {
 public:
  RowReader(const std::filesystem::path& file, char separator, Problem (*parse_row)(Fields, Row&))
      : RowReader(std::make_unique<std::ifstream>(file), file.string(), separator, parse_row) {
    if (!*stream_ || std::filesystem::is_directory(file)) {
      problem_ = fmt::format("{}: cannot be read; check the path and its permissions", name_);
    }
  }

  /// Of any lines; `name` stands for them in problems.
  RowReader(std::unique_ptr<std::istream> stream, std::string name, char separator, Problem (*parse_row)(Fields, Row&))
      : stream_(std::move(stream)), name_(std::move(name)), split_(separator), parse_row_(parse_row) {}

  /// False at the end, and where there is a problem.
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

  /// Puts the place of the latest row before what is wrong with it.
  void report(const std::string& problem) { problem_ = fmt::format("{}:{}: {}", name_, line_, problem); }
  [[nodiscard]] const Problem& problem() const { return problem_; }
  /// Whether the problem is that of a last line that was not written to its end.
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
