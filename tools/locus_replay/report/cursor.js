// SPDX-License-Identifier: Apache-2.0
// One instant that all figures point at. Whoever draws it is told when it moves, and null when there is none.
import {bisectLeft} from "d3-array";

const listeners = new Map();
let instant = null;

/** A figure that is drawn anew takes the place of what it was. */
export function onCursor(figure, listener) {
  listeners.set(figure, listener);
  listener(instant);
}

export function moveCursor(t) {
  instant = t;
  for (const listener of listeners.values()) listener(t);
}

export const cursor = () => instant;

/** Index of the value in ascending `times` that is nearest to `t`. */
export function nearest(times, t) {
  const after = Math.min(bisectLeft(times, t), times.length - 1);
  return after > 0 && t - times[after - 1] < times[after] - t ? after - 1 : after;
}
