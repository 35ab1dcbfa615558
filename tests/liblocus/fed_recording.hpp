// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "core/base/stamp.hpp"
#include "liblocus.hpp"

/// Recordings read by the readers of the project and fed to the library by hand.
namespace locus::test {

struct FedDatagram {
  Stamp arrival;
  std::uint16_t port = 0;
  std::uint32_t source_ip = 0;
  std::vector<std::byte> payload;
};

std::vector<FedDatagram> datagrams_of(const std::vector<std::filesystem::path>& captures);
void write_pcap(const std::vector<FedDatagram>& datagrams, const std::filesystem::path& file);

/// All that the datagrams give, to the end.
std::vector<liblocus::Estimate> feed(liblocus::Odometry& odometry, const std::vector<FedDatagram>& datagrams);

/// The same of a capture folder with its motion, in the order of arrival; a sample before a datagram of the same time.
std::vector<liblocus::Estimate> feed(liblocus::Odometry& odometry, const std::filesystem::path& folder);

} // namespace locus::test
