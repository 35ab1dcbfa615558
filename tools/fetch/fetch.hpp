// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <variant>

#include "core/base/expected.hpp"
#include "drivers/hesai/model.hpp"
#include "drivers/ouster/metadata.hpp"

namespace locus::tools {

/// What only the sensor has, as it sent it and as the decoders understand it: an Ouster's metadata, or the angles of a
/// Hesai.
struct SensorFile {
  std::string text; ///< to be written as it is
  std::variant<ouster::Metadata, hesai::Calibration> content;
};

/// Where lidars answer questions, all TCP, and how long each of the three is waited for.
struct FetchOptions {
  std::uint16_t ouster_http_port = 80;
  std::uint16_t ouster_command_port = 7501; ///< of older firmware
  std::uint16_t hesai_ptc_port = 9347;
  std::chrono::milliseconds patience{5000};
};

/// Asks the lidar at a numeric address, IPv4 or IPv6, for its file; what answers tells the maker. Waits up to three
/// times the patience, for somebody who does not answer. Fails with lines for the user: what each port said, and what
/// to do. Any thread.
Expected<SensorFile, std::string> fetch_sensor_file(const std::string& address, const FetchOptions& options = {});

} // namespace locus::tools
