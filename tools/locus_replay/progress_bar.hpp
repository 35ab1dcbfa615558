// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/base/stamp.hpp"

namespace locus::tools {

/// Progress line of a long task on the terminal; silent if stderr is not a terminal, and during the first second,
/// within which most tasks finish. One owner.
class ProgressBar {
 public:
  explicit ProgressBar(bool wanted);
  ~ProgressBar() { wipe(); }
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;

  /// Shows the share `done`, 0..1. May be called at any rate.
  void show(double done);
  void wipe();

 private:
  bool enabled_;
  bool drawn_ = false;
  Duration begin_;
  Duration next_;
};

} // namespace locus::tools
