// SPDX-License-Identifier: Apache-2.0
// Data of the run shown by this page, as embedded by locus-replay (report.cpp).
import {unfolded} from "./octahedral.js";

export const run = JSON.parse(document.getElementById("run").textContent);
export const summary = run.summary;

/** Start of the first sweep and end of the last, in seconds after the start of the capture. */
export const begin_s = Math.max((run.path?.t[0] ?? 0) - (run.period_s ?? 0), 0);
export const end_s = run.path?.t.at(-1) ?? 0;

/** The tiles of the map: centres, unit normals, and the side of a tile. */
export const map = run.map ? decode(run.map) : {count: 0};

function decode({tile_m, count, origin_m, step_m, data}) {
  const bytes = Uint8Array.from(atob(data), (character) => character.charCodeAt(0));
  const view = new DataView(bytes.buffer);
  const centres = new Float32Array(3 * count), normals = new Float32Array(3 * count);
  for (let i = 0; i < count; ++i) {
    for (let axis = 0; axis < 3; ++axis)
      centres[3 * i + axis] = origin_m[axis] + step_m * view.getInt16(8 * i + 2 * axis, true);
    normals.set(unfolded(view.getInt8(8 * i + 6) / 127, view.getInt8(8 * i + 7) / 127), 3 * i);
  }
  return {tile_m, count, centres, normals};
}
