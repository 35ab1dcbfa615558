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

/// Data that only the sensor has, as sent by it and as the decoders accept it: an Ouster's metadata, or a Hesai's
/// angles.
struct SensorFile {
  std::string text; ///< written unchanged
  std::variant<ouster::Metadata, hesai::Calibration> content;
};

/// TCP ports of the lidars' services, and the timeout for each of the three.
struct FetchOptions {
  std::uint16_t ouster_http_port = 80;
  std::uint16_t ouster_command_port = 7501; ///< of older firmware
  std::uint16_t hesai_ptc_port = 9347;
  std::chrono::milliseconds patience{5000};
};

/// Requests the file of the lidar at a numeric address, IPv4 or IPv6; the service that answers identifies the maker.
/// Blocks for up to three timeouts. Fails with lines for the user: the result on each port, and a remedy. Any thread.
Expected<SensorFile, std::string> fetch_sensor_file(const std::string& address, const FetchOptions& options = {});

} // namespace locus::tools
