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
#include "drivers/lidar_input.hpp"
#include "faults/fault_injection.hpp"
#include "locus_sim/stream_text.hpp"

namespace locus::tools {

/// A capture in one file or pipe, as locus-sim -o - writes it (see sim::StreamSink); one of lidar packets alone is one,
/// too. One owner.
class CaptureStream {
 public:
  explicit CaptureStream(Capture capture);
  CaptureStream(const CaptureStream&) = delete;
  CaptureStream& operator=(const CaptureStream&) = delete;

  /// config.yaml, where the stream begins with it; else empty.
  [[nodiscard]] const std::string& config() const { return config_; }
  /// The next datagram behind that, valid until the next call; nullptr at the end.
  const Datagram* next();
  [[nodiscard]] const Capture& capture() const { return capture_; }

 private:
  Capture capture_;
  const Datagram* head_; ///< read ahead
  std::string config_;
};

/// Datagrams and motion samples of a stream in the order of their arrival, faults injected, read as they are asked for.
///
/// The seconds of a fault count from the first packet. What faults swallow leaves Silence behind. True poses are left
/// out. A text that cannot be read ends the stream, and problem() says which. One owner.
class StreamRecording : public daemon::InputSource {
 public:
  /// `stream` must outlive this; `lidars`: to tell whose datagram a fault strikes. Precondition: fault_problem() finds
  /// nothing.
  StreamRecording(CaptureStream& stream, const Config& config, LidarRouter lidars, std::vector<Fault> faults);

  daemon::Input next(Duration timeout) override;

  /// Files of the stream that no motion source is configured for.
  [[nodiscard]] const std::set<std::string>& unknown_files() const { return unknown_files_; }
  /// A line for the user.
  [[nodiscard]] const std::optional<std::string>& problem() const { return problem_; }

 private:
  struct OwnedInput {
    daemon::Input input; ///< a datagram without payload
    std::vector<std::byte> payload;
  };
  struct Source {
    SourceId id;
    std::variant<SampleFaults<ImuSample>, SampleFaults<OdometrySample>> faults;
  };

  void read();
  void begin(Stamp start);
  void take(const sim::StreamText& text, Stamp arrival);
  template <class Sample> void take(const sim::StreamText& text, Stamp arrival, Source& source);
  void keep(const Datagram& datagram);
  void keep(SourceId source, const ImuSample& sample);
  void keep(SourceId source, const OdometrySample& sample);
  void end();

  CaptureStream& stream_;
  const Config& config_;
  LidarRouter lidars_; ///< never receives anything
  std::vector<Fault> faults_;
  std::optional<DatagramFaults> lidar_faults_; ///< from the first packet on
  std::map<std::string, Source> sources_;      ///< by the file that they stand in
  std::multimap<Stamp, OwnedInput> waiting_;   ///< read, not given out yet; by arrival
  OwnedInput given_out_;
  Stamp now_; ///< arrival of the latest datagram read, Stamp::max() after the last
  std::set<std::string> unknown_files_;
  std::optional<std::string> problem_;
};

} // namespace locus::tools
