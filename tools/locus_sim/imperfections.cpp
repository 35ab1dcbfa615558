// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/imperfections.hpp"

namespace locus::sim {

Imperfections imperfections_of(Realism realism) {
  Imperfections all;
  if (realism == Realism::clean)
    return all;
  for (const NamedImperfection& one : kImperfections)
    all.*one.size = realism == Realism::real ? one.real : one.harsh;
  return all;
}

} // namespace locus::sim
