// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "core/odometry/odometry_estimate.hpp"

namespace locus::test {

/// Checksum of bytes (FNV-1a, 64 bits).
class Checksum {
 public:
  void add(std::string_view bytes);
  template <class Value> void add_value(const Value& value) {
    static_assert(std::is_arithmetic_v<Value>, "without padding");
    add({reinterpret_cast<const char*>(&value), sizeof value});
  }
  [[nodiscard]] std::string text() const; ///< 16 hexadecimal digits

 private:
  std::uint64_t sum_ = 0xcbf29ce484222325U;
};

/// Returns the checksum of a file, or of all files of a folder and their names. Throws std::runtime_error if one cannot
/// be read.
std::string checksum_of(const std::filesystem::path& recording);

/// Estimates of one drive as text for diffs: about one line per second, more for a short drive, and a checksum of the
/// bits of all sweeps, which reveals changes that no line shows.
struct Trace {
  /// One sweep. The numbers are those of kColumns.
  struct Line {
    std::string text;
    double t_s = 0; ///< since the first sweep
    std::string state;
    std::array<double, 18> numbers{};
  };

  std::string options;   ///< of locus-sim and locus-replay, or the name of the recording
  std::string recording; ///< checksum of the replayed recording
  std::string estimates; ///< checksum of stamp, state, pose, twist and covariance of all sweeps
  std::size_t sweeps = 0;
  std::vector<Line> lines;

  static Trace of(const std::string& options, const std::string& recording,
                  const std::vector<OdometryEstimate>& estimates);
  /// Returns nothing if the text is no trace.
  static std::optional<Trace> parse(const std::string& text);
  [[nodiscard]] std::string text() const;
};

/// Tolerance between the estimates of two instruction sets, which add the same numbers in different order.
///
/// The differences are rounding errors and the decisions that depend on them: one more iteration, a point in another
/// voxel. They are below a sensor's resolution: a VLP-16 resolves 2 mm in range and 0.01 degrees in azimuth. Poses may
/// therefore differ by half of the former and all of the latter; twists, being differences over a sweep of 50 ms, by
/// twice that per 50 ms. Standard deviations must be correct to a factor of 1.4 (a NEES of 3 to 12, ideal 6); half of
/// that is allowed here.
struct Tolerance {
  double position_m = 1e-3;
  double rotation_rad = 1.7e-4;
  double velocity_mps = 0.04;
  double turn_rate_radps = 7e-3;
  double sigma_share = 0.2;
};

/// Returns nothing if `found` equals the accepted trace to the last bit; else a readable description: the first
/// differing line, the largest changes.
std::optional<std::string> difference(const Trace& accepted, const Trace& found);

/// Returns nothing if all lines agree within `tolerance` and have equal states; else a description.
std::optional<std::string> difference_beyond(const Tolerance& tolerance, const Trace& accepted, const Trace& found);

} // namespace locus::test
