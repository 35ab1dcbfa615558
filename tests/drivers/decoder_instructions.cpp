// SPDX-License-Identifier: Apache-2.0
// decoder_instructions: decodes packets of every model of Hesai, and of Ousters in the usual profiles, and counts the
// instructions by callgrind; each count is a dump of callgrind's. Prints name and number of returns of each.
// decoder_instructions.sh runs it and compares.
#include <valgrind/callgrind.h>

#include <cstdint>
#include <cstdio>
#include <string>

#include "drivers/hesai/decoder.hpp"
#include "drivers/hesai_test_packet.hpp"
#include "drivers/ouster/decoder.hpp"
#include "drivers/ouster_test_packet.hpp"
#include "support/returns.hpp"

namespace {

using namespace locus;

constexpr int kPackets = 64;

/// Counts the decoding of this packet, after one for the initialisation.
template <class Decoder>
void count(const std::string& name, Decoder&& decoder, std::span<const std::byte> payload, LidarPacket& packet) {
  if (decoder.decode(payload, packet)) {
    std::fprintf(stderr, "%s: the packet is refused\n", name.c_str());
    return;
  }
  CALLGRIND_START_INSTRUMENTATION;
  CALLGRIND_TOGGLE_COLLECT;
  for (int i = 0; i < kPackets; ++i)
    decoder.decode(payload, packet);
  CALLGRIND_TOGGLE_COLLECT;
  CALLGRIND_STOP_INSTRUMENTATION;
  CALLGRIND_DUMP_STATS_AT(name.c_str());
  std::printf("%s %zu\n", name.c_str(), kPackets * test::count_returns(packet));
}

/// Three quarters of the firings of a dense scene have a return.
class Dense {
 public:
  /// Returns the next distance, in units of the format; 0: no return.
  std::uint32_t next(unsigned bits) {
    random_ = random_ * 1'664'525U + 1'013'904'223U;
    return random_ >> 30 == 0 ? 0 : random_ << 2 >> (32 - bits);
  }

 private:
  std::uint32_t random_ = 1;
};

void count_ouster(ouster::Profile profile, std::size_t pixels, LidarPacket& packet) {
  const ouster::Metadata metadata = test::ouster_metadata(profile, pixels);
  const ouster::ProfileSpec& its = spec(profile);
  test::OusterTestPacket bytes{metadata};
  Dense dense;
  for (std::size_t column = 0; column < metadata.columns_per_packet; ++column)
    for (std::size_t pixel = 0; pixel < pixels; ++pixel)
      for (std::size_t echo = 0; echo < its.echoes; ++echo)
        bytes.set_return(column, pixel, dense.next(its.range_bits) << its.range_shift, 10, echo);
  bytes.seal();
  count("OS1-" + std::to_string(pixels) + "/" + std::string{its.name}, ouster::Decoder{metadata, Isa::baseline},
        bytes.payload(), packet);
}

void count_hesai(hesai::Model model, std::uint8_t mode, LidarPacket& packet) {
  constexpr unsigned kDistanceBits = 16;
  const hesai::PacketLayout& layout = hesai::spec(model).layout;
  test::HesaiTestPacket bytes{model, mode};
  Dense dense;
  for (std::size_t block = 0; block < layout.blocks; ++block)
    for (std::size_t channel = 0; channel < layout.channels; ++channel)
      bytes.set_return(block, channel, static_cast<std::uint16_t>(dense.next(kDistanceBits)));
  bytes.seal();
  count(std::string{to_string(model)} + "/" + std::string{to_string(*hesai::return_mode_from_byte(mode))},
        hesai::Decoder{{.isa = Isa::baseline}}, bytes.payload(), packet);
}

} // namespace

int main() {
  static LidarPacket packet;
  for (const std::size_t pixels : {32U, 128U})
    for (const auto profile : {ouster::Profile::legacy, ouster::Profile::rng19, ouster::Profile::rng19_dual,
                               ouster::Profile::rng15, ouster::Profile::rng15_dual})
      count_ouster(profile, pixels, packet);
  for (std::size_t model = 0; model < hesai::kModels; ++model)
    for (const std::uint8_t mode : {std::uint8_t{0x37}, std::uint8_t{0x39}})
      count_hesai(static_cast<hesai::Model>(model), mode, packet);
}
