// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/base/stamp.hpp"

namespace locus::tools {

/// A line on the terminal that shows how far a long task has come; nothing where stderr is no terminal, and nothing in
/// the first second, by which most are done. One owner.
class ProgressBar {
 public:
  explicit ProgressBar(bool wanted);
  ~ProgressBar() { wipe(); }
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;

  /// `done`: 0..1. May be called as often as one likes.
  void show(double done);
  void wipe();

 private:
  bool enabled_;
  bool drawn_ = false;
  Duration begin_;
  Duration next_;
};

} // namespace locus::tools
