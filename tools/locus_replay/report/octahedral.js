// SPDX-License-Identifier: Apache-2.0

/** Decodes a normal from its octahedral coordinates, see tools/pages/octahedral.hpp. */
export function unfolded(u, v) {
  const z = 1 - Math.abs(u) - Math.abs(v);
  const x = z >= 0 ? u : (1 - Math.abs(v)) * (u < 0 ? -1 : 1);
  const y = z >= 0 ? v : (1 - Math.abs(u)) * (v < 0 ? -1 : 1);
  const length = Math.hypot(x, y, z);
  return [x / length, y / length, z / length];
}
