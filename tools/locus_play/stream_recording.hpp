// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <variant>
#include <vector>

#include "config/config.hpp"
#include "daemon/input.hpp"
#include "drivers/files/capture.hpp"
#include "drivers/lidar_router.hpp"
#include "faults/fault_injection.hpp"
#include "locus_sim/stream_text.hpp"

namespace locus::tools {

/// Capture in one file or pipe, as written by locus-sim -o - (see sim::StreamSink), or any capture of lidar packets.
/// One owner.
class CaptureStream {
 public:
  explicit CaptureStream(Capture capture);
  CaptureStream(const CaptureStream&) = delete;
  CaptureStream& operator=(const CaptureStream&) = delete;

  /// Returns config.yaml, if the stream begins with it; else empty text.
  [[nodiscard]] const std::string& config() const { return config_; }
  /// Returns the next datagram, valid until the next call; nullptr at the end.
  const Datagram* next();
  [[nodiscard]] const Capture& capture() const { return capture_; }

 private:
  Capture capture_;
  const Datagram* head_; ///< read ahead
  std::string config_;
};

/// Datagrams and motion samples of a stream in order of arrival, with faults injected, read on demand.
///
/// The seconds of a fault count from the first packet. Inputs dropped by a fault yield Silence. True poses are skipped.
/// An unreadable text ends the stream, and problem() identifies it. One owner.
class StreamRecording : public daemon::InputSource {
 public:
  /// Expects `stream` to outlive this; `lidars` identify the lidar of a datagram. Precondition: fault_problem() returns
  /// nothing.
  StreamRecording(CaptureStream& stream, const Config& config, LidarRouter lidars, std::vector<Fault> faults);

  daemon::Input next(Duration timeout) override;

  /// Returns the files of the stream without a motion source in the configuration.
  [[nodiscard]] const std::set<std::string>& unknown_files() const { return unknown_files_; }
  /// Returns a line for the user.
  [[nodiscard]] const std::optional<std::string>& problem() const { return problem_; }

 private:
  struct OwnedInput {
    daemon::Input input; ///< datagrams without payload
    std::vector<std::byte> payload;
  };
  struct Source {
    SourceId id;
    std::variant<SampleFaults<ImuSample>, SampleFaults<OdometrySample>> faults;
  };

  void read();
  void begin(Stamp start);
  void read_text(const sim::StreamText& text, Stamp arrival);
  template <class Sample> void read_samples(const sim::StreamText& text, Stamp arrival, Source& source);
  void enqueue(const Datagram& datagram);
  void enqueue(SourceId source, const ImuSample& sample);
  void enqueue(SourceId source, const OdometrySample& sample);
  void end();

  CaptureStream& stream_;
  const Config& config_;
  LidarRouter lidars_; ///< for look-ups only
  std::vector<Fault> faults_;
  std::optional<DatagramFaults> lidar_faults_; ///< from the first packet on
  std::map<std::string, Source> sources_;      ///< by file name
  std::multimap<Stamp, OwnedInput> waiting_;   ///< read but not returned yet; by arrival
  OwnedInput current_;
  Stamp now_; ///< arrival of the latest datagram read, Stamp::max() after the last
  std::set<std::string> unknown_files_;
  std::optional<std::string> problem_;
};

} // namespace locus::tools
