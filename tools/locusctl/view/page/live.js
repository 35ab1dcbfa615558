// SPDX-License-Identifier: Apache-2.0
// Picture of the robot as sent by locusctl view (live_view.hpp), completed by each answer.
import {unfolded} from "../../../locus_replay/report/octahedral.js";

const kTileBytes = 16, kPositionBytes = 12;

export class Live {
  constructor() {
    this.epoch = 0;
    this.tiles = null;  // {max, count, tile_m, centres, normals}
    this.path = [];     // x, y, z, x, ...
    this.sweep = new Float32Array(0);
    this.pose = null;  // {sequence, missed, xyz_m, quaternion_xyzw}
    this.status = null;
    this.problem = "";
    this.length_m = 0;
    this.skipped = 0;  // sweeps that arrived between two answers
  }

  /** Returns the address of what is lacking. */
  query() {
    return `live?epoch=${this.epoch}&tiles=${this.tiles?.count ?? 0}&positions=${this.path.length / 3}` +
        `&sequence=${this.pose?.sequence ?? 0}`;
  }

  /** Adds an answer. Returns which parts have changed, and whether there is more to be had at once. */
  add(buffer) {
    const length = new DataView(buffer).getUint32(0, true);
    const json = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
    const is_new = json.epoch !== this.epoch;
    const {tiles, path, sweep} = json;
    if (is_new) this.path = [];
    if (!this.tiles || is_new) this.tiles = this.emptyTiles(tiles);
    this.epoch = json.epoch;
    this.status = json.status;
    this.problem = json.problem;
    this.length_m = path.length_m;
    let at = 4 + length;
    this.addTiles(new DataView(buffer, at, tiles.count * kTileBytes), tiles);
    at += tiles.count * kTileBytes;
    for (const coordinate of new Float32Array(buffer, at, 3 * path.count)) this.path.push(coordinate);
    at += path.count * kPositionBytes;
    const has_sweep = sweep !== undefined && (is_new || sweep.sequence !== this.pose?.sequence);
    if (has_sweep) {
      if (!is_new && this.pose) this.skipped += sweep.sequence - this.pose.sequence - 1 - (sweep.missed - this.pose.missed);
      this.sweep = new Float32Array(buffer, at, 3 * sweep.count);
      this.pose = sweep;
    }
    return {
      is_new,
      first_tile: tiles.from,
      tiles: is_new || tiles.count > 0,
      path: is_new || path.count > 0,
      sweep: has_sweep,
      more: tiles.from + tiles.count < tiles.total
    };
  }

  emptyTiles({max, side_m}) {
    const {centres, normals} = this.tiles ?? {centres: new Float32Array(3 * max), normals: new Float32Array(3 * max)};
    return {max, count: 0, tile_m: side_m, centres, normals};
  }

  addTiles(view, {from, count}) {
    const {centres, normals} = this.tiles;
    for (let i = 0; i < count; ++i) {
      const at = kTileBytes * i, to = 3 * (from + i);
      for (let axis = 0; axis < 3; ++axis) centres[to + axis] = view.getFloat32(at + 4 * axis, true);
      normals.set(unfolded(view.getInt8(at + 12) / 127, view.getInt8(at + 13) / 127), to);
    }
    this.tiles.count = from + count;
  }
}
