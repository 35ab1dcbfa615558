// SPDX-License-Identifier: Apache-2.0
#include "drivers/files/motion_files.hpp"

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <initializer_list>
#include <iterator>
#include <memory>
#include <optional>
#include <sstream>
#include <utility>

#include <fmt/format.h>

#include "drivers/files/motion_rows.hpp"

namespace locus {
namespace {

void apply(const Meta& meta, ImuSample& sample) { sample.arrival = meta.arrival; }
void apply(const Meta& meta, OdometrySample& sample) {
  sample.arrival = meta.arrival;
  sample.covariance_scale = meta.covariance_scale;
}

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

/// Assigns each row of a meta file to the sample with its stamp. Stamps may repeat, equally in both files, and may
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

/// Format of the table of a sample type.
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
  return samples;
}

constexpr Duration kLongestBack = std::chrono::milliseconds{100}; ///< of samples that are merely out of order

/// Implements MotionSamples::steps_back().
template <class Sample> std::size_t count_steps_back(const std::vector<Sample>& samples) {
  std::size_t count = 0;
  for (std::size_t i = 1; i < samples.size(); ++i)
    count += samples[i].arrival < samples[i - 1].arrival - kLongestBack ? 1U : 0U;
  return count;
}

/// Appends a number with `decimals` decimals, or with the fewest digits that preserve its value.
void append_number(std::string& line, double number, std::optional<int> decimals) {
  if (decimals) {
    fmt::format_to(std::back_inserter(line), "{:.{}f}", number, *decimals);
  } else {
    fmt::format_to(std::back_inserter(line), "{}", number);
  }
}

} // namespace

std::string to_line(const ImuSample& sample, std::optional<int> decimals) {
  const Eigen::Vector3d &w = sample.angular_velocity_radps, &a = sample.specific_force_mps2;
  std::string line = fmt::format("{}", to_ns(sample.stamp));
  const auto append = [&](std::initializer_list<double> numbers) {
    for (const double number : numbers) {
      line += ',';
      append_number(line, number, decimals);
    }
  };
  append({w.x(), w.y(), w.z(), a.x(), a.y(), a.z()});
  if (sample.attitude) {
    append({sample.attitude->w(), sample.attitude->x(), sample.attitude->y(), sample.attitude->z()});
  }
  return line + '\n';
}

/// Formats one pose. Integer arithmetic preserves the nanoseconds of the stamp.
std::string to_line(const StampedPose& pose, std::optional<int> decimals) {
  const std::int64_t ns = to_ns(pose.stamp);
  const Eigen::Vector3d& p = pose.T_source_base.translation;
  const Eigen::Quaterniond& q = pose.T_source_base.rotation;
  std::string line =
      fmt::format("{}{}.{:09}", ns < 0 ? "-" : "", std::abs(ns) / 1'000'000'000, std::abs(ns) % 1'000'000'000);
  for (const double number : {p.x(), p.y(), p.z(), q.x(), q.y(), q.z(), q.w()}) {
    line += ' ';
    append_number(line, number, decimals);
  }
  return line + '\n';
}

Expected<std::vector<StampedPose>, std::string> read_trajectory(const std::filesystem::path& file,
                                                                bool clock_may_be_set) {
  RowReader<OdometrySample> reader = open_table<OdometrySample>(file);
  const Duration longest_back = clock_may_be_set ? kLongestBack : Duration::max();
  constexpr double kFarthest_m = 1e8; // covers geocentric coordinates; squares stay finite
  std::vector<StampedPose> poses;
  for (OdometrySample sample; reader.next(sample);) {
    if (!sample.T_source_base.finite()) {
      reader.report("the pose is not finite; remove the line");
    } else if (sample.T_source_base.translation.cwiseAbs().maxCoeff() > kFarthest_m) {
      reader.report("the position is more than 100000 km from the origin; write metres, or remove the line");
    } else if (!poses.empty() && sample.stamp <= poses.back().stamp &&
               poses.back().stamp - sample.stamp <= longest_back) {
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
  poses.shrink_to_fit(); // an hour at 100 Hz still takes 30 MB
  return poses;
}

template <class Sample> Expected<std::vector<Sample>, std::string> parse_samples(std::string lines, std::string name) {
  RowReader<Sample> reader(std::make_unique<std::istringstream>(std::move(lines)), std::move(name),
                           Table<Sample>::kSeparator, Table<Sample>::kParse);
  return all_rows(reader);
}

template Expected<std::vector<ImuSample>, std::string> parse_samples(std::string, std::string);
template Expected<std::vector<OdometrySample>, std::string> parse_samples(std::string, std::string);

/// Rows of all files in file order, each combined with its row of the meta file.
template <class Sample> class MotionSamples<Sample>::Rows {
 public:
  explicit Rows(std::vector<std::filesystem::path> files) : files_(std::move(files)) {}

  /// Returns false at the end, on a problem, and if a meta file has another order.
  bool next(Sample& sample) {
    while (!problem_ && in_step_ && (samples_ || next_file_ < files_.size())) {
      if (!samples_) {
        open();
      }
      if (samples_->next(sample)) {
        latest_ = sample.stamp;
        add_meta(sample);
        return !problem_ && in_step_;
      }
      end_file();
    }
    return false;
  }

  [[nodiscard]] const Problem& problem() const { return problem_; }
  /// Returns true while every row of a meta file matches the sample at the same position.
  [[nodiscard]] bool in_step() const { return in_step_; }
  [[nodiscard]] const std::vector<std::string>& breaks() const { return breaks_; }

 private:
  void open() {
    const std::filesystem::path& file = files_[next_file_++];
    samples_.emplace(open_table<Sample>(file));
    if (const std::filesystem::path meta = meta_file_of(file); std::filesystem::exists(meta)) {
      meta_.emplace(meta, ',', &parse_meta);
    }
  }

  void add_meta(Sample& sample) {
    Meta row;
    if (meta_ && meta_->next(row)) {
      in_step_ = row.stamp == sample.stamp;
      apply(row, sample);
    } else if (meta_) {
      note(*meta_);
      meta_.reset();
    }
  }

  /// Ends a file. A file and its meta file that were not fully written differ in length; that is reported, not an
  /// error.
  void end_file() {
    note(*samples_);
    Meta row;
    if (meta_ && meta_->next(row)) {
      in_step_ = !latest_ || row.stamp > *latest_;
      breaks_.push_back(fmt::format("{}: breaks off before its meta file does; what is there is used",
                                    files_[next_file_ - 1].string()));
    } else if (meta_) {
      note(*meta_);
    }
    samples_.reset();
    meta_.reset();
    latest_.reset();
  }

  template <class Row> void note(const RowReader<Row>& ended) {
    if (ended.breaks_off()) {
      breaks_.push_back(fmt::format("{}; the file breaks off there, what is before it is used", *ended.problem()));
    } else {
      problem_ = problem_ ? problem_ : ended.problem();
    }
  }

  std::vector<std::filesystem::path> files_;
  std::size_t next_file_ = 0;
  std::optional<RowReader<Sample>> samples_; ///< empty between two files
  std::optional<RowReader<Meta>> meta_;
  std::optional<Stamp> latest_; ///< latest sample of this file
  bool in_step_ = true;
  Problem problem_;
  std::vector<std::string> breaks_;
};

template <class Sample>
Expected<MotionSamples<Sample>, std::string> MotionSamples<Sample>::open(std::vector<std::filesystem::path> files,
                                                                         Order order) {
  Rows rows(files);
  const auto is_pipe = [](const std::filesystem::path& file) { return !std::filesystem::is_regular_file(file); };
  const bool read_once = std::ranges::any_of(files, is_pipe);
  std::optional<TimeSpan> arrivals;
  std::vector<Sample> all;
  bool in_order = true;
  for (Sample sample; rows.next(sample);) {
    if (read_once)
      all.push_back(sample);
    in_order &= !arrivals || sample.arrival >= arrivals->last;
    arrivals = {arrivals ? arrivals->first : sample.arrival, sample.arrival};
  }
  if (rows.problem()) {
    return *rows.problem();
  }
  if (read_once && !rows.in_step()) {
    return fmt::format("{}: a pipe, whose meta file is not in its order; save it as a file", files.front().string());
  }
  if (!read_once && rows.in_step() && in_order) {
    MotionSamples samples(std::make_unique<Rows>(std::move(files)), arrivals);
    samples.breaks_ = rows.breaks();
    return samples;
  }
  if (!read_once && rows.in_step()) {
    Rows again(std::move(files));
    for (Sample sample; again.next(sample);) {
      all.push_back(sample);
    }
  } else if (!read_once) {
    for (const std::filesystem::path& file : files) {
      Expected<std::vector<Sample>, std::string> of_file = read_samples<Sample>(file);
      if (!of_file) {
        return of_file.error();
      }
      std::ranges::move(*of_file, std::back_inserter(all));
    }
  }
  if (order == Order::arrival || count_steps_back(all) == 0)
    std::ranges::stable_sort(all, {}, &Sample::arrival);
  MotionSamples samples(std::move(all));
  samples.breaks_ = rows.breaks();
  return samples;
}

template <class Sample>
MotionSamples<Sample>::MotionSamples(std::unique_ptr<Rows> rows, std::optional<TimeSpan> arrivals)
    : arrivals_(arrivals), rows_(std::move(rows)) {
  pop();
}

template <class Sample> MotionSamples<Sample>::MotionSamples(std::vector<Sample> samples) : held_(std::move(samples)) {
  if (!held_.empty()) {
    const auto [first, last] = std::ranges::minmax(held_, {}, &Sample::arrival);
    arrivals_ = {first.arrival, last.arrival};
  }
  steps_back_ = count_steps_back(held_);
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
