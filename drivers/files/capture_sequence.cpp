// SPDX-License-Identifier: Apache-2.0
#include "drivers/files/capture_sequence.hpp"

#include <algorithm>
#include <iterator>
#include <utility>

namespace locus {

Expected<CaptureSequence, std::string> CaptureSequence::open(std::vector<std::filesystem::path> files, Opener opener) {
  CaptureSequence sequence(std::move(files), std::move(opener));
  if (!sequence.open_next())
    return sequence.warnings_.front();
  return sequence;
}

/// Opens the next file that can be opened. Returns false if there is none.
bool CaptureSequence::open_next() {
  while (next_file_ < files_.size()) {
    Expected<Capture, std::string> next = opener_(files_[next_file_++]);
    if (!next) {
      warnings_.push_back(next.error());
      continue;
    }
    if (capture_) {
      before_ += capture_->datagrams();
      std::ranges::move(capture_->warnings(), std::back_inserter(warnings_));
    }
    capture_.emplace(std::move(*next));
    return true;
  }
  return false;
}

const Datagram* CaptureSequence::next() {
  const Datagram* datagram = capture_->next();
  while (datagram == nullptr && open_next())
    datagram = capture_->next();
  return datagram;
}

std::vector<std::string> CaptureSequence::warnings() const {
  std::vector<std::string> all = warnings_;
  std::ranges::move(capture_->warnings(), std::back_inserter(all));
  return all;
}

double CaptureSequence::progress() const {
  return (static_cast<double>(next_file_) - 1 + capture_->progress()) / static_cast<double>(files_.size());
}

} // namespace locus
