// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <stdexcept>
#include <utility>

#include "drivers/files/capture.hpp"
#include "drivers/files/pcap_writer.hpp"

namespace locus::test {

inline Bytes payload_of(std::size_t size) {
  Bytes payload(size);
  for (std::size_t i = 0; i < size; ++i)
    payload[i] = static_cast<std::byte>(i & 0xFF);
  return payload;
}

inline Capture opened(const std::filesystem::path& file) {
  Expected<Capture, std::string> capture = Capture::open(file);
  if (!capture)
    throw std::runtime_error(capture.error());
  return std::move(*capture);
}

inline void append_little_endian(Bytes& bytes, std::uint64_t value, int count) {
  for (int shift = 0; shift < 8 * count; shift += 8)
    bytes.push_back(static_cast<std::byte>(value >> shift & 0xFF));
}

} // namespace locus::test
