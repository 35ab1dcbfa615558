// SPDX-License-Identifier: Apache-2.0
// Recognition of the model by the bytes of a data packet.
#include <algorithm>

#include "drivers/hesai/model.hpp"

namespace locus::hesai {

namespace {

constexpr std::size_t kOldPandar40Bytes = 1256; ///< plus four with a sequence number

/// Status versions by which the maker's SDK tells the models of protocol 1.4 apart: Pandar128, OT128, JT128.
constexpr std::byte kFirstStatusOfOt128{128}, kFirstStatusOfJt128{137};

bool opens_with(std::span<const std::byte> payload, unsigned first, unsigned second) {
  return payload.size() > 12 && payload[0] == std::byte(first) && payload[1] == std::byte(second);
}

bool has_layout_of(const ModelSpec& its, std::span<const std::byte> payload) {
  const PacketLayout& layout = its.layout;
  if (layout.header == 0)
    return opens_with(payload, 0xFF, 0xEE) && std::ranges::find(its.lengths, payload.size()) != its.lengths.end();
  const std::size_t sizes = layout.header == 8 ? 2 : 6;
  const auto number = [&](std::size_t at) { return std::to_integer<std::size_t>(payload[at]); };
  return opens_with(payload, 0xEE, 0xFF) && number(sizes) == layout.channels && number(sizes + 1) == layout.blocks &&
         (layout.header == 8 || (number(2) == its.version[0] && number(3) == its.version[1]));
}

bool has_status_of_ot128(std::span<const std::byte> payload) {
  return payload[4] >= kFirstStatusOfOt128 && payload[4] < kFirstStatusOfJt128;
}

/// Unsupported models whose packets start with EE FF, by protocol version.
struct Unread {
  unsigned major, minor;
  std::string_view name;
};
constexpr std::array kUnread{Unread{1, 3, "Pandar128"}, Unread{1, 4, "Pandar128"}, Unread{1, 8, "JT16"},
                             Unread{2, 4, "ET25"},      Unread{2, 5, "ET25"},      Unread{2, 6, "ET25"},
                             Unread{2, 7, "ET30"},      Unread{3, 1, "QT32"},      Unread{4, 1, "AT128"},
                             Unread{4, 3, "AT128"},     Unread{4, 7, "ATX"},       Unread{7, 2, "FT120"}};

} // namespace

bool has_layout_of(Model model, std::span<const std::byte> payload) { return has_layout_of(spec(model), payload); }

std::optional<Looks> look_at(std::span<const std::byte> payload) {
  if (!opens_with(payload, 0xFF, 0xEE) && !opens_with(payload, 0xEE, 0xFF))
    return std::nullopt;
  if (opens_with(payload, 0xFF, 0xEE) &&
      (payload.size() == kOldPandar40Bytes || payload.size() == kOldPandar40Bytes + 4))
    return Looks{"Pandar40", std::nullopt};
  for (std::size_t i = 0; i < kModels; ++i) {
    const auto model = static_cast<Model>(i);
    if (has_layout_of(model, payload) && (model != Model::ot128 || has_status_of_ot128(payload)))
      return Looks{to_string(model), model};
  }
  if (!opens_with(payload, 0xEE, 0xFF))
    return std::nullopt;
  if (has_layout_of(Model::ot128, payload) && payload[4] >= kFirstStatusOfJt128)
    return Looks{"JT128", std::nullopt};
  const auto unread = std::ranges::find_if(kUnread, [&](const Unread& one) {
    return payload[2] == std::byte(one.major) && payload[3] == std::byte(one.minor);
  });
  return Looks{unread == kUnread.end() ? "of an unknown model" : unread->name, std::nullopt};
}

} // namespace locus::hesai
