// SPDX-License-Identifier: Apache-2.0
// Requests of local users to the control socket of the service.
#include <cmath>
#include <variant>

#include "daemon/service/control.hpp"
#include "fuzz/fuzz_bytes.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace locus;
  const auto request = daemon::parse_control_request(fuzz::text_of(data, size));
  fuzz::demand(request || !request.error().empty());
  if (!request)
    return 0;
  if (const auto* reset = std::get_if<daemon::Reset>(&*request); reset != nullptr && reset->T_odom_base) {
    fuzz::demand(reset->T_odom_base->translation.allFinite());
    fuzz::demand(std::abs(reset->T_odom_base->rotation.norm() - 1.0) < 1e-6);
  }
  return 0;
}
