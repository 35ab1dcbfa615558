// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

namespace locus::test {

inline std::vector<std::byte> read_file(const std::filesystem::path& file) {
  std::ifstream stream{file, std::ios::binary};
  const std::string text{std::istreambuf_iterator<char>{stream}, {}};
  std::vector<std::byte> bytes(text.size());
  std::memcpy(bytes.data(), text.data(), text.size());
  return bytes;
}

/// Reads a binary PCD file whose fields have the layout of `Point`.
template <class Point> std::vector<Point> read_binary_pcd(const std::filesystem::path& file) {
  const std::string kEndOfHeader = "DATA binary\n";
  const std::vector<std::byte> bytes = read_file(file);
  const std::string text{reinterpret_cast<const char*>(bytes.data()), bytes.size()};
  const std::size_t data = text.find(kEndOfHeader) + kEndOfHeader.size();
  std::vector<Point> points((bytes.size() - data) / sizeof(Point));
  std::memcpy(points.data(), bytes.data() + data, points.size() * sizeof(Point));
  return points;
}

} // namespace locus::test
