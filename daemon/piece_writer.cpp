// SPDX-License-Identifier: Apache-2.0
#include "daemon/piece_writer.hpp"

#include <cerrno>
#include <system_error>
#include <utility>

#include <fmt/format.h>
#include <unistd.h>

#include "config/config_yaml.hpp"
#include "daemon/capture_ring.hpp"
#include "drivers/files/capture_folder.hpp"
#include "drivers/files/motion_files.hpp"

namespace locus::daemon {

namespace {

using std::filesystem::path;

/// File buffer: holds the samples of one round of the recorder, so that they are written at once.
constexpr std::size_t kBufferBytes = 1 << 16;

bool is_storable(Stamp stamp) { return stamp > kEarliestStamp && stamp < kLatestStamp; }

std::string write_failure_text(const std::filesystem::path& file) {
  return fmt::format("{}: cannot be written ({}); check permissions and free space", file.string(),
                     std::generic_category().message(errno));
}

/// Copies the metadata without which an Ouster's packets cannot be decoded; skipped if the original no longer exists.
std::optional<std::string> copy_metadata(const LidarOptions& lidar, const path& folder) {
  std::error_code error;
  if (!lidar.is_ouster() || !std::filesystem::exists(lidar.metadata, error))
    return std::nullopt;
  const path copy = folder / metadata_file(lidar.name);
  std::filesystem::copy_file(lidar.metadata, copy, std::filesystem::copy_options::overwrite_existing, error);
  return error ? std::optional{disk_failure_text("cannot be written", copy, error)} : std::nullopt;
}

} // namespace

std::vector<std::optional<std::string>> sample_files(const Config& config) {
  std::vector<std::optional<std::string>> files;
  bool has_imu = false;
  for (const MotionSource& source : config.motion_sources) {
    const bool is_reserved_name = source.kind == SourceKind::odometry && (source.name == "gt" || source.name == "imu");
    if (is_reserved_name || source.of_lidar) // samples in a lidar's packets are recorded with them
      files.emplace_back(std::nullopt);
    else if (source.kind == SourceKind::odometry)
      files.emplace_back(source.name + ".tum");
    else
      files.push_back(std::exchange(has_imu, true) ? std::nullopt : std::optional<std::string>{"imu.csv"});
  }
  return files;
}

Expected<PieceWriter, std::string> PieceWriter::open(const std::filesystem::path& folder, const Config& config) {
  auto pcap = PcapWriter::open(folder / "lidar.pcap");
  if (!pcap)
    return pcap.error();
  PieceWriter writer(std::move(*pcap), folder, config);
  writer.append(writer.config_, print_config(config));
  for (const LidarOptions& lidar : config.lidars)
    if (auto problem = copy_metadata(lidar, folder))
      return *problem;
  if (auto problem = writer.flush(false))
    return *problem;
  return writer;
}

PieceWriter::PieceWriter(PcapWriter pcap, const std::filesystem::path& folder, const Config& config)
    : pcap_(std::move(pcap)), config_{folder / "config.yaml"} {
  for (const std::optional<std::string>& file : sample_files(config)) {
    SourceFiles& source = sources_.emplace_back();
    if (file) {
      source.samples.path = source.meta.path = folder / *file;
      source.meta.path.replace_extension(".meta.csv");
    }
  }
}

bool PieceWriter::write(const ImuInput& input) {
  return write(input.source, input.sample.stamp, input.sample.arrival, 1.0, to_line(input.sample));
}

bool PieceWriter::write(const OdometryInput& input) {
  const OdometrySample& sample = input.sample;
  return sample.T_source_base.rotation.norm() != 0.0 &&
         write(input.source, sample.stamp, sample.arrival, sample.covariance_scale,
               to_line({sample.stamp, sample.T_source_base}));
}

bool PieceWriter::write(SourceId source, Stamp stamp, Stamp arrival, double covariance_scale, const std::string& line) {
  SourceFiles& files = sources_[index_of(source)];
  if (files.samples.path.empty() || !is_storable(stamp) || !is_storable(arrival))
    return false;
  append(files.samples, line);
  append(files.meta, fmt::format("{},{},{}\n", to_ns(stamp), to_ns(arrival), covariance_scale));
  return true;
}

void PieceWriter::append(TextFile& file, const std::string& text) {
  if (!file.file && !problem_) {
    file.file.reset(std::fopen(file.path.c_str(), "we"));
    if (file.file)
      std::setvbuf(file.file.get(), nullptr, _IOFBF, kBufferBytes);
    else
      problem_ = write_failure_text(file.path);
  }
  if (file.file && std::fwrite(text.data(), 1, text.size(), file.file.get()) != text.size() && !problem_)
    problem_ = write_failure_text(file.path);
  text_bytes_ += text.size();
}

/// Flushes the samples before their meta rows, so that a crash in between loses only rows.
std::optional<std::string> PieceWriter::flush(bool to_disk) {
  const auto flush_text = [&](TextFile& file) {
    if (file.file && !problem_ &&
        (std::fflush(file.file.get()) != 0 || (to_disk && fdatasync(fileno(file.file.get())) != 0)))
      problem_ = write_failure_text(file.path);
  };
  if (!problem_)
    problem_ = pcap_.flush();
  if (to_disk && !problem_ && fdatasync(pcap_.descriptor()) != 0)
    problem_ = write_failure_text(config_.path.parent_path() / "lidar.pcap");
  flush_text(config_);
  for (SourceFiles& source : sources_) {
    flush_text(source.samples);
    flush_text(source.meta);
  }
  return problem_;
}

} // namespace locus::daemon
