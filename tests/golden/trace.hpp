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

/// Sum of bytes that differs when one bit of them does (FNV-1a, 64 bits).
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

/// Of a file, or of all files of a folder with their names. Throws std::runtime_error where one cannot be read.
std::string checksum_of(const std::filesystem::path& recording);

/// The estimates of one drive as a text that is read in a diff: a line about once a second, of a short drive more
/// often, and a checksum of the bits of all sweeps, which tells of what no line shows.
struct Trace {
  /// One sweep. The numbers are those of kColumns.
  struct Line {
    std::string text;
    double t_s = 0; ///< since the first sweep
    std::string state;
    std::array<double, 18> numbers{};
  };

  std::string options;   ///< of locus-sim and locus-replay, or the name of the recording
  std::string recording; ///< checksum of what was replayed
  std::string estimates; ///< checksum of stamp, state, pose, twist and covariance of every sweep
  std::size_t sweeps = 0;
  std::vector<Line> lines;

  static Trace of(const std::string& options, const std::string& recording,
                  const std::vector<OdometryEstimate>& estimates);
  /// Nothing for what is no trace.
  static std::optional<Trace> parse(const std::string& text);
  [[nodiscard]] std::string text() const;
};

/// How far the estimates of two instruction sets may be apart, which add the same numbers in another order.
///
/// They are apart by rounding errors, and by what the odometry decides by these: one more iteration, a point in another
/// voxel. A sensor resolves none of it: a VLP-16 tells ranges by 2 mm and azimuths by 0.01 degrees. So poses may differ
/// by half of the one and all of the other, twists by twice that in a sweep of 50 ms, which they are differences over.
/// Standard deviations are asked to be good to a factor of 1.4 (a normalised squared error of 3 to 12 for 6); half of
/// that is allowed.
struct Tolerance {
  double position_m = 1e-3;
  double rotation_rad = 1.7e-4;
  double velocity_mps = 0.04;
  double turn_rate_radps = 7e-3;
  double sigma_share = 0.2;
};

/// Nothing where `found` is what was accepted to the last bit. Else what differs, for people: the first line, the
/// largest changes.
std::optional<std::string> difference(const Trace& accepted, const Trace& found);

/// Nothing where they are as close as `tolerance`, line by line, in the same states.
std::optional<std::string> difference_beyond(const Tolerance& tolerance, const Trace& accepted, const Trace& found);

} // namespace locus::test
