// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include <fmt/format.h>
#include <nettle/sha2.h>

namespace locus {

/// SHA-256 of bytes added in any pieces.
class Sha256 {
 public:
  Sha256() { sha256_init(&context_); }

  void add(std::span<const std::byte> bytes) {
    sha256_update(&context_, bytes.size(), reinterpret_cast<const std::uint8_t*>(bytes.data()));
  }

  /// Returns the digest of the bytes so far as 64 hexadecimal digits.
  [[nodiscard]] std::string hex() const {
    sha256_ctx context = context_; // the digest resets it
    std::array<std::uint8_t, SHA256_DIGEST_SIZE> digest{};
    sha256_digest(&context, digest.size(), digest.data());
    return fmt::format("{:02x}", fmt::join(digest, ""));
  }

 private:
  sha256_ctx context_{};
};

} // namespace locus
