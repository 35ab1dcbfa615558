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

/// Readers of recorded motion. All skip blank lines and lines that start with #, and accept CRLF. Text that is not a
/// number is an error, one line for the user: `file:line: what; what to do`.

/// Closed interval of time.
struct TimeSpan {
  Stamp first, last;
};

/// Samples of a motion source in order of arrival. Arrivals come from STEM.meta.csv
/// (`t_ns,arrival_ns,covariance_scale`) beside the file if it exists; otherwise arrival = stamp. NaN is accepted, as
/// from a live sensor. Format for ImuSample: EuRoC's table with an optional attitude and header line, rad/s and m/s^2:
/// `t_ns,wx,wy,wz,ax,ay,az[,qw,qx,qy,qz]`. Format for OdometrySample: TUM, seconds and metres: `t x y z qx qy qz qw`;
/// nanoseconds of the time are preserved.
///
/// A recording in pieces has several consecutive files. A file that ends in mid-line, because power was lost, is read
/// up to that line.
///
/// An hour of an IMU would take 100 MB: files whose samples are in order of arrival, with meta rows in the order of the
/// samples, are streamed; other files and pipes are held in memory. Single owner, not thread-safe.
template <class Sample> class MotionSamples {
 public:
  enum class Order { arrival, recorded };

  /// Reads all files once, so that errors are reported before the first sample is used. Order::recorded leaves samples
  /// in the order of the files if their arrivals go back by a clock's step, see steps_back().
  static Expected<MotionSamples, std::string> open(std::vector<std::filesystem::path> files,
                                                   Order order = Order::arrival);
  static Expected<MotionSamples, std::string> open(const std::filesystem::path& file) {
    return open(std::vector{file});
  }

  /// Holds the given samples in this order.
  explicit MotionSamples(std::vector<Sample> samples);
  MotionSamples(MotionSamples&&) noexcept;
  MotionSamples& operator=(MotionSamples&&) noexcept;
  ~MotionSamples();

  /// Earliest and latest arrival; empty if there are no samples.
  [[nodiscard]] const std::optional<TimeSpan>& arrivals() const { return arrivals_; }

  /// Number of samples that arrive more than 0.1 s before the preceding one: a clock was set, or the order is wrong.
  [[nodiscard]] std::size_t steps_back() const { return steps_back_; }

  /// Positions where files were cut off, one line for the user each.
  [[nodiscard]] const std::vector<std::string>& breaks() const { return breaks_; }

  /// Next sample, valid until pop(); nullptr after the last.
  [[nodiscard]] const Sample* front() const { return ended_ ? nullptr : &front_; }
  void pop();

  /// Returns all remaining samples.
  std::vector<Sample> drain();

 private:
  class Rows;
  MotionSamples(std::unique_ptr<Rows> rows, std::optional<TimeSpan> arrivals);

  std::optional<TimeSpan> arrivals_;
  std::size_t steps_back_ = 0;
  std::vector<std::string> breaks_;
  std::unique_ptr<Rows> rows_; ///< nullptr: the samples are held in memory
  std::vector<Sample> held_;
  std::size_t next_ = 0; ///< index into held_
  Sample front_;
  bool ended_ = false;
};

/// Parses samples from lines of such a file, arrival = stamp; `name` stands for the file in errors.
template <class Sample> Expected<std::vector<Sample>, std::string> parse_samples(std::string lines, std::string name);

/// Pose of the base at one instant.
struct StampedPose {
  Stamp stamp;
  Pose T_source_base; ///< frame of the motion source
};

/// Formats one line of such a file including the line feed, with `decimals` decimals for each number; without them,
/// with as many digits as needed to read the same number again.
std::string to_line(const ImuSample& sample, std::optional<int> decimals = {});
std::string to_line(const StampedPose& pose, std::optional<int> decimals = {});

/// Reads a TUM file as a reference, with stricter checks: finite, on Earth, strictly increasing in time, at least one
/// pose. `clock_may_be_set`: accepts times that go back by more than 0.1 s. Thread-safe.
Expected<std::vector<StampedPose>, std::string> read_trajectory(const std::filesystem::path& file,
                                                                bool clock_may_be_set = false);

} // namespace locus
