// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "core/base/stamp.hpp"
#include "liblocus.hpp"

/// Reads recordings with the project's readers and feeds them to the library.
namespace locus::test {

struct FedDatagram {
  Stamp arrival;
  std::uint16_t port = 0;
  std::uint32_t source_ip = 0;
  std::vector<std::byte> payload;
};

std::vector<FedDatagram> datagrams_of(const std::vector<std::filesystem::path>& captures);
void write_pcap(const std::vector<FedDatagram>& datagrams, const std::filesystem::path& file);

/// Feeds all datagrams and finishes; returns the estimates.
std::vector<liblocus::Estimate> feed(liblocus::Odometry& odometry, const std::vector<FedDatagram>& datagrams);

/// Feeds a capture folder and its motion in order of arrival; a sample precedes a datagram of the same time.
std::vector<liblocus::Estimate> feed(liblocus::Odometry& odometry, const std::filesystem::path& folder);

} // namespace locus::test
