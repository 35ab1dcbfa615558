// SPDX-License-Identifier: Apache-2.0
#include "drivers/motion_files.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <memory>
#include <optional>
#include <span>
#include <sstream>
#include <string_view>
#include <system_error>
#include <utility>

#include <fmt/format.h>

namespace locus {
namespace {

constexpr std::size_t kMaxFields = 11;
using Fields = std::span<const std::string_view>;
using Problem = std::optional<std::string>; ///< what is wrong with a line, and what to do

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view kBlanks = " \t\r";
  const std::size_t first = text.find_first_not_of(kBlanks);
  return first == std::string_view::npos ? std::string_view{}
                                         : text.substr(first, text.find_last_not_of(kBlanks) - first + 1);
}

/// Splits at commas, or at runs of blanks for the separator ' '. A line with more fields than fit is returned with one
/// more than kMaxFields, which no format has.
class FieldSplitter {
 public:
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

template <class Number> bool parse(std::string_view text, Number& number) {
  const char* end = text.data() + text.size();
  const char* begin = text.data() + (text.starts_with('+') ? 1 : 0); // from_chars takes no plus sign
  const auto [stop, error] = std::from_chars(begin, end, number);
  return error == std::errc{} && stop == end;
}

bool parse_all(Fields fields, std::span<double> numbers) {
  return std::ranges::equal(fields, numbers, [](std::string_view text, double& number) { return parse(text, number); });
}

bool is_sensible(Stamp stamp) { return stamp > kEarliestStamp && stamp < kLatestStamp; }

/// A whole number of nanoseconds.
std::optional<Stamp> parse_ns(std::string_view text) {
  std::int64_t ns = 0;
  return parse(text, ns) && is_sensible(stamp_from_ns(ns)) ? std::optional{stamp_from_ns(ns)} : std::nullopt;
}

/// Decimal seconds, rounded to nanoseconds without a detour over double, whose steps are 200 ns at today's dates. Takes
/// an exponent too: NumPy writes 1.403636579763555527e+09.
std::optional<Stamp> parse_seconds(std::string_view text) {
  constexpr int kMaxExponent = 18;
  const std::size_t exponent_at = std::min(text.find_first_of("eE"), text.size());
  int exponent = 0;
  if (exponent_at < text.size() &&
      (!parse(text.substr(exponent_at + 1), exponent) || exponent < -kMaxExponent || exponent > kMaxExponent)) {
    return std::nullopt;
  }
  const bool negative = text.starts_with('-');
  std::string digits{text.substr(negative ? 1 : 0, exponent_at - (negative ? 1 : 0))};
  const std::size_t point = std::min(digits.find('.'), digits.size());
  if (point < digits.size()) {
    digits.erase(point, 1);
  }
  if (digits.empty() || digits.find_first_not_of("0123456789") != std::string::npos) {
    return std::nullopt;
  }
  const int digits_of_ns = static_cast<int>(point) + exponent + 9;
  if (digits_of_ns <= 0) {
    return Stamp{};
  }
  const auto kept = static_cast<std::size_t>(digits_of_ns);
  const bool rounds_up = kept < digits.size() && digits[kept] >= '5';
  digits.resize(kept, '0');
  const std::optional<Stamp> stamp = parse_ns(digits);
  if (!stamp) {
    return std::nullopt;
  }
  const std::int64_t ns = to_ns(*stamp) + (rounds_up ? 1 : 0);
  return stamp_from_ns(negative ? -ns : ns);
}

/// A first line in which nothing is a number.
bool is_header(Fields fields) {
  return std::ranges::none_of(fields, [](std::string_view field) {
    double ignored = 0.0;
    return parse(field, ignored);
  });
}

/// A rotation, NaN included. Nothing when the four numbers are none, which tells columns in another order from a
/// quaternion rounded by the writer.
std::optional<Eigen::Quaterniond> unit_quaternion(double w, double x, double y, double z) {
  constexpr double kTolerance = 0.05;
  const Eigen::Quaterniond q{w, x, y, z};
  if (std::abs(q.norm() - 1.0) > kTolerance) {
    return std::nullopt;
  }
  return q.normalized();
}

Problem parse_imu(Fields fields, ImuSample& sample) {
  if (fields.size() != 7 && fields.size() != 11) {
    return fmt::format("{} columns; expected t_ns,wx,wy,wz,ax,ay,az and optionally qw,qx,qy,qz",
                       fields.size() > kMaxFields ? "too many" : std::to_string(fields.size()));
  }
  const std::optional<Stamp> time = parse_ns(fields[0]);
  if (!time) {
    return fmt::format(
        "time \"{}\" is not a whole number of nanoseconds; since 1970; write it without point or exponent", fields[0]);
  }
  std::array<double, kMaxFields - 1> v{};
  if (!parse_all(fields.subspan(1), std::span{v}.first(fields.size() - 1))) {
    return "a value is not a number; correct or remove the line";
  }
  sample.stamp = sample.arrival = *time;
  sample.angular_velocity_radps = {v[0], v[1], v[2]};
  sample.specific_force_mps2 = {v[3], v[4], v[5]};
  const bool unknown_attitude =
      fields.size() == 7 || std::all_of(v.begin() + 6, v.end(), [](double q) { return q == 0; });
  if (unknown_attitude) {
    return std::nullopt;
  }
  sample.attitude = unit_quaternion(v[6], v[7], v[8], v[9]);
  if (!sample.attitude) {
    return "the attitude is not a unit quaternion; the columns are qw,qx,qy,qz, all four 0 where it is not known";
  }
  return std::nullopt;
}

Problem parse_odometry(Fields fields, OdometrySample& sample) {
  if (fields.size() != 8) {
    return fmt::format("{} columns; expected t x y z qx qy qz qw",
                       fields.size() > kMaxFields ? "too many" : std::to_string(fields.size()));
  }
  const std::optional<Stamp> time = parse_seconds(fields[0]);
  if (!time) {
    return fmt::format("time \"{}\" is not a number of seconds since 1970; write it as 1700000000.123456789",
                       fields[0]);
  }
  std::array<double, 7> v{};
  if (!parse_all(fields.subspan(1), v)) {
    return "a value is not a number; correct or remove the line";
  }
  const std::optional<Eigen::Quaterniond> rotation = unit_quaternion(v[6], v[3], v[4], v[5]);
  if (!rotation) {
    return "the rotation is not a unit quaternion; the columns are t x y z qx qy qz qw";
  }
  sample.stamp = sample.arrival = *time;
  sample.T_source_base = {*rotation, {v[0], v[1], v[2]}};
  return std::nullopt;
}

struct Meta {
  Stamp stamp;
  Stamp arrival;
  double covariance_scale = 1.0;
};

Problem parse_meta(Fields fields, Meta& meta) {
  const std::optional<Stamp> time = fields.size() == 3 ? parse_ns(fields[0]) : std::nullopt;
  const std::optional<Stamp> arrival = fields.size() == 3 ? parse_ns(fields[1]) : std::nullopt;
  if (!time || !arrival || !parse(fields[2], meta.covariance_scale)) {
    return "expected t_ns,arrival_ns,covariance_scale: two whole numbers and a number; correct or remove the line";
  }
  meta.stamp = *time;
  meta.arrival = *arrival;
  return std::nullopt;
}

void apply(const Meta& meta, ImuSample& sample) { sample.arrival = meta.arrival; }
void apply(const Meta& meta, OdometrySample& sample) {
  sample.arrival = meta.arrival;
  sample.covariance_scale = meta.covariance_scale;
}

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

template <class Row> Expected<std::vector<Row>, std::string> all_rows(RowReader<Row>& reader) {
  std::vector<Row> rows;
  for (Row row; reader.next(row);) {
    rows.push_back(row);
  }
  if (reader.problem()) {
    return *reader.problem();
  }
  return rows;
}

/// Gives each row of a meta file to the sample of its stamp. Stamps may repeat, in both files the same way, and may
/// differ by less than a microsecond, the rounding of a trajectory written with six decimals.
template <class Sample>
Problem apply_meta(const std::filesystem::path& file, std::vector<Sample>& samples, std::vector<Meta> rows) {
  constexpr Duration kRounding = std::chrono::microseconds{1};
  std::ranges::stable_sort(samples, {}, &Sample::stamp);
  std::ranges::stable_sort(rows, {}, &Meta::stamp);
  auto sample = samples.begin();
  for (const Meta& row : rows) {
    sample = std::find_if(sample, samples.end(), [&](const Sample& s) { return s.stamp > row.stamp - kRounding; });
    if (sample == samples.end() || sample->stamp >= row.stamp + kRounding) {
      return fmt::format("{}: no sample at t_ns {}; the file belongs to another recording or was written twice",
                         file.string(), to_ns(row.stamp));
    }
    apply(row, *sample++);
  }
  return std::nullopt;
}

/// How the table of a kind of sample is written.
template <class Sample> struct Table;
template <> struct Table<ImuSample> {
  static constexpr char kSeparator = ',';
  static constexpr auto kParse = &parse_imu;
};
template <> struct Table<OdometrySample> {
  static constexpr char kSeparator = ' ';
  static constexpr auto kParse = &parse_odometry;
};
template <class Sample> RowReader<Sample> open_table(const std::filesystem::path& file) {
  return {file, Table<Sample>::kSeparator, Table<Sample>::kParse};
}

std::filesystem::path meta_file_of(std::filesystem::path file) { return file.replace_extension(".meta.csv"); }

template <class Sample> Expected<std::vector<Sample>, std::string> read_samples(const std::filesystem::path& file) {
  RowReader<Sample> reader = open_table<Sample>(file);
  Expected<std::vector<Sample>, std::string> samples = all_rows(reader);
  if (!samples) {
    return samples;
  }
  if (const std::filesystem::path meta_file = meta_file_of(file); std::filesystem::exists(meta_file)) {
    RowReader<Meta> meta_reader(meta_file, ',', &parse_meta);
    const Expected<std::vector<Meta>, std::string> rows = all_rows(meta_reader);
    if (!rows) {
      return rows.error();
    }
    if (Problem problem = apply_meta(meta_file, *samples, *rows)) {
      return *std::move(problem);
    }
  }
  std::ranges::stable_sort(*samples, {}, &Sample::arrival);
  return samples;
}

} // namespace

Expected<std::vector<StampedPose>, std::string> read_trajectory(const std::filesystem::path& file) {
  RowReader<OdometrySample> reader = open_table<OdometrySample>(file);
  constexpr double kFarthest_m = 1e8; // geocentric coordinates are within it, and their squares are numbers
  std::vector<StampedPose> poses;
  for (OdometrySample sample; reader.next(sample);) {
    if (!sample.T_source_base.finite()) {
      reader.report("the pose is not finite; remove the line");
    } else if (sample.T_source_base.translation.cwiseAbs().maxCoeff() > kFarthest_m) {
      reader.report("the position is more than 100000 km from the origin; write metres, or remove the line");
    } else if (!poses.empty() && sample.stamp <= poses.back().stamp) {
      reader.report("its time is not after that of the pose before; sort the lines by time and keep one of each");
    }
    poses.push_back({sample.stamp, sample.T_source_base});
  }
  if (reader.problem()) {
    return *reader.problem();
  }
  if (poses.empty()) {
    return fmt::format("{}: holds no pose; expected lines of t x y z qx qy qz qw", file.string());
  }
  poses.shrink_to_fit(); // an hour at 100 Hz fills 30 MB as it is
  return poses;
}

template <class Sample> Expected<std::vector<Sample>, std::string> parse_samples(std::string lines, std::string name) {
  RowReader<Sample> reader(std::make_unique<std::istringstream>(std::move(lines)), std::move(name),
                           Table<Sample>::kSeparator, Table<Sample>::kParse);
  return all_rows(reader);
}

template Expected<std::vector<ImuSample>, std::string> parse_samples(std::string, std::string);
template Expected<std::vector<OdometrySample>, std::string> parse_samples(std::string, std::string);

template <class Sample> class MotionSamples<Sample>::Rows {
 public:
  explicit Rows(const std::filesystem::path& file) : reader_(open_table<Sample>(file)) {}

  bool next(Sample& sample) { return reader_.next(sample); }
  [[nodiscard]] const Problem& problem() const { return reader_.problem(); }

 private:
  RowReader<Sample> reader_;
};

template <class Sample>
Expected<MotionSamples<Sample>, std::string> MotionSamples<Sample>::open(const std::filesystem::path& file) {
  bool in_order = !std::filesystem::exists(meta_file_of(file));
  Rows rows(file);
  std::optional<TimeSpan> arrivals;
  for (Sample sample; in_order && rows.next(sample);) {
    in_order = !arrivals || sample.arrival >= arrivals->last;
    arrivals = {arrivals ? arrivals->first : sample.arrival, sample.arrival};
  }
  if (rows.problem()) {
    return *rows.problem();
  }
  if (in_order) {
    return MotionSamples(std::make_unique<Rows>(file), arrivals);
  }
  Expected<std::vector<Sample>, std::string> samples = read_samples<Sample>(file);
  if (!samples) {
    return samples.error();
  }
  return MotionSamples(std::move(*samples));
}

template <class Sample>
MotionSamples<Sample>::MotionSamples(std::unique_ptr<Rows> rows, std::optional<TimeSpan> arrivals)
    : arrivals_(arrivals), rows_(std::move(rows)) {
  pop();
}

template <class Sample> MotionSamples<Sample>::MotionSamples(std::vector<Sample> samples) : held_(std::move(samples)) {
  if (!held_.empty())
    arrivals_ = {held_.front().arrival, held_.back().arrival};
  pop();
}

template <class Sample> MotionSamples<Sample>::MotionSamples(MotionSamples&&) noexcept = default;
template <class Sample> MotionSamples<Sample>& MotionSamples<Sample>::operator=(MotionSamples&&) noexcept = default;
template <class Sample> MotionSamples<Sample>::~MotionSamples() = default;

template <class Sample> void MotionSamples<Sample>::pop() {
  if (rows_) {
    ended_ = !rows_->next(front_);
  } else if (next_ < held_.size()) {
    front_ = held_[next_++];
  } else {
    ended_ = true;
  }
}

template <class Sample> std::vector<Sample> MotionSamples<Sample>::drain() {
  std::vector<Sample> samples;
  for (; front() != nullptr; pop()) {
    samples.push_back(front_);
  }
  return samples;
}

template class MotionSamples<ImuSample>;
template class MotionSamples<OdometrySample>;

} // namespace locus
