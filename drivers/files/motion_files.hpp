// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/base/expected.hpp"
#include "core/sources/motion_sample.hpp"

namespace locus {

/// Readers of recorded motion. All skip blank lines and lines that start with # and accept CRLF. Text that is no number
/// is an error, one line for the user: `file:line: what; what to do`.

/// From an instant to another one, which belongs to it.
struct TimeSpan {
  Stamp first, last;
};

/// What a motion source said, sample by sample in the order of arrival: that of STEM.meta.csv
/// (`t_ns,arrival_ns,covariance_scale`) beside the file where there is one, else arrival = stamp. NaN passes, as it
/// does from a live sensor. The file is, of ImuSample, EuRoC's table with an optional attitude and header line, rad/s
/// and m/s^2: `t_ns,wx,wy,wz,ax,ay,az[,qw,qx,qy,qz]`; of OdometrySample TUM's, seconds and metres: `t x y z qx qy qz
/// qw`, of whose time the nanoseconds are kept.
///
/// A recording in pieces has several files, one after the other. One that breaks off in mid-line, because the computer
/// was switched off, is read up to there.
///
/// One hour of an IMU would fill 100 MB: files in which the samples stand in the order of arrival, and their meta rows
/// in that of the samples, are read as they are asked for, and only others are held, as are those of a pipe. One owner.
template <class Sample> class MotionSamples {
 public:
  /// Reads the files through, so that what is wrong with them is known before the first sample is used.
  static Expected<MotionSamples, std::string> open(std::vector<std::filesystem::path> files);
  static Expected<MotionSamples, std::string> open(const std::filesystem::path& file) {
    return open(std::vector{file});
  }

  /// In the order of their arrival.
  explicit MotionSamples(std::vector<Sample> samples);
  MotionSamples(MotionSamples&&) noexcept;
  MotionSamples& operator=(MotionSamples&&) noexcept;
  ~MotionSamples();

  /// When the first and the last one arrive; nothing if there is none.
  [[nodiscard]] const std::optional<TimeSpan>& arrivals() const { return arrivals_; }

  /// Where a file breaks off, one line for the user each.
  [[nodiscard]] const std::vector<std::string>& breaks() const { return breaks_; }

  /// The next one, valid until pop(); nullptr after the last.
  [[nodiscard]] const Sample* front() const { return ended_ ? nullptr : &front_; }
  void pop();

  /// All that are left.
  std::vector<Sample> drain();

 private:
  class Rows;
  MotionSamples(std::unique_ptr<Rows> rows, std::optional<TimeSpan> arrivals);

  std::optional<TimeSpan> arrivals_;
  std::vector<std::string> breaks_;
  std::unique_ptr<Rows> rows_; ///< nullptr: the samples are held
  std::vector<Sample> held_;
  std::size_t next_ = 0; ///< of those held
  Sample front_;
  bool ended_ = false;
};

/// The samples in lines of such a file, arrival = stamp; `name` stands for the file in errors.
template <class Sample> Expected<std::vector<Sample>, std::string> parse_samples(std::string lines, std::string name);

/// Where the base was at one instant.
struct StampedPose {
  Stamp stamp;
  Pose T_source_base; ///< in the frame of whoever says so
};

/// One line of such a file, line feed included, with `decimals` of each number; without, with as many digits as it
/// takes to read the same number again.
std::string to_line(const ImuSample& sample, std::optional<int> decimals = {});
std::string to_line(const StampedPose& pose, std::optional<int> decimals = {});

/// TUM's table as something to measure by, so more is asked of it: finite, on Earth, in the order of time, at least one
/// pose. Any thread.
Expected<std::vector<StampedPose>, std::string> read_trajectory(const std::filesystem::path& file);

} // namespace locus
