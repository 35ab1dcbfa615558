// SPDX-License-Identifier: Apache-2.0
#include "locus_experiments/recordings.hpp"

#include <algorithm>
#include <set>
#include <system_error>

#include <fmt/format.h>

#include "bags/bag.hpp"
#include "drivers/files/capture_folder.hpp"
#include "kitti/kitti_drive.hpp"
#include "locus_replay/failure.hpp"
#include "sweep_folder/sweep_folder.hpp"

namespace locus::experiments {
namespace {

using std::filesystem::path;

bool is_folder(const path& where) {
  std::error_code ignored;
  return std::filesystem::is_directory(where, ignored);
}

/// Returns true for an invalid capture folder, too: locus-replay reports the mistake.
bool is_recording(const path& where) {
  if (tools::KittiDrive::is(where) || tools::looks_like_bag(where) || tools::SweepFolder::is(where))
    return true;
  if (!is_folder(where))
    return is_named_as_capture(where);
  return !captures_in(where).empty() || CaptureFolder::find(where);
}

std::vector<path> entries_of(const path& folder) {
  std::error_code error;
  std::vector<path> entries;
  for (std::filesystem::directory_iterator entry{folder, error}, end; !error && entry != end; entry.increment(error))
    entries.push_back(entry->path());
  std::ranges::sort(entries); // directory order is unspecified
  return entries;
}

/// Searches each folder once, even if several links lead to it.
class Search {
 public:
  explicit Search(const path& output) { visit(output); }

  void look_into(const path& root, const std::string& prefix) {
    root_ = root;
    prefix_ = prefix;
    look_at(root);
  }
  std::vector<FoundRecording> found;

 private:
  bool visit(const path& folder) {
    std::error_code ignored;
    return visited_.insert(std::filesystem::weakly_canonical(folder, ignored)).second;
  }

  [[nodiscard]] std::string unique(const std::string& name) const {
    std::string counted = name;
    for (int count = 2; std::ranges::find(found, counted, &FoundRecording::name) != found.end(); ++count)
      counted = fmt::format("{}-{}", name, count);
    return counted;
  }

  void look_at(const path& where) {
    const bool folder = is_folder(where);
    if (folder && !visit(where))
      return;
    if (is_recording(where)) {
      const std::string inside = where == root_ ? "" : where.lexically_relative(root_).string();
      found.push_back({unique(prefix_ + inside), where});
      return;
    }
    for (const path& entry : folder ? entries_of(where) : std::vector<path>{})
      look_at(entry);
  }

  path root_;
  std::string prefix_;
  std::set<path> visited_;
};

} // namespace

std::vector<FoundRecording> find_recordings(const std::vector<path>& places, const path& output) {
  Search search(output);
  for (const path& place : places) {
    std::error_code ignored;
    if (!std::filesystem::exists(place, ignored))
      throw tools::Failure(tools::ExitStatus::failed,
                           fmt::format("{}: not found; name folders with recordings", place.string()));
    const path root = std::filesystem::absolute(place / "").parent_path().lexically_normal();
    const std::string own_name = root.filename().string();
    const bool needs_prefix = places.size() > 1;
    search.look_into(root, is_recording(root) ? own_name : needs_prefix ? own_name + '/' : "");
  }
  return std::move(search.found);
}

} // namespace locus::experiments
