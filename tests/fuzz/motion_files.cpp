// SPDX-License-Identifier: Apache-2.0
// Motion tables: each input is read as IMU, as odometry and as true poses. After a line of three dashes follows its
// meta file. Samples are validated as in a replay.
#include <cmath>
#include <string>

#include "core/sources/health_monitor.hpp"
#include "drivers/files/motion_files.hpp"
#include "fuzz/memory_file.hpp"

namespace locus {
namespace {

using fuzz::demand;

constexpr std::string_view kBehindTable = "---\n";

/// A table and its meta file in one folder, named as the reader expects.
class Folder {
 public:
  Folder() {
    demand(mkdtemp(path_.data()) != nullptr);
    std::filesystem::create_symlink(table_.with(""), std::filesystem::path(path_) / "fuzz.csv");
    std::filesystem::create_symlink(meta_.with(""), std::filesystem::path(path_) / "fuzz.meta.csv");
  }
  ~Folder() { std::filesystem::remove_all(path_); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;

  /// Returns the path of a table with a meta file.
  [[nodiscard]] std::filesystem::path with(std::string_view table, std::string_view meta) const {
    static_cast<void>(table_.with(table));
    static_cast<void>(meta_.with(meta));
    return std::filesystem::path(path_) / "fuzz.csv";
  }

 private:
  std::string path_ = std::filesystem::temp_directory_path() / "fuzz_motion_XXXXXX";
  fuzz::MemoryFile table_, meta_;
};

template <class Sample> void play(const std::filesystem::path& file, SourceKind kind) {
  auto samples = MotionSamples<Sample>::open(file);
  if (!samples)
    return;
  const auto arrivals = samples->arrivals();
  demand(arrivals.has_value() == (samples->front() != nullptr));
  HealthMonitor health{{.name = "fuzz", .kind = kind, .T_base_source = {}}};
  for (Stamp last = Stamp::min(); samples->front() != nullptr; samples->pop()) {
    demand(samples->front()->arrival >= last && samples->front()->arrival <= arrivals->last);
    last = samples->front()->arrival;
    static_cast<void>(health.judge(*samples->front()));
  }
}

} // namespace
} // namespace locus

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace locus;
  static const fuzz::MemoryFile kFile;
  static const Folder kFolder;
  const std::string_view text = fuzz::text_of(data, size);
  if (const std::size_t end = text.find(kBehindTable); end != std::string_view::npos) {
    const std::filesystem::path file = kFolder.with(text.substr(0, end), text.substr(end + kBehindTable.size()));
    play<ImuSample>(file, SourceKind::imu);
    play<OdometrySample>(file, SourceKind::odometry);
    return 0;
  }
  const std::filesystem::path file = kFile.with(text);
  play<ImuSample>(file, SourceKind::imu);
  play<OdometrySample>(file, SourceKind::odometry);
  if (const auto poses = read_trajectory(file))
    for (const StampedPose& pose : *poses)
      demand(pose.T_source_base.finite());
  return 0;
}
