// SPDX-License-Identifier: Apache-2.0
// Common cursor of all figures: notifies them when it moves to a time, and with null when it disappears.
import {bisectLeft} from "d3-array";

const listeners = new Map();
let instant = null;

/** Registers a figure; a redrawn one replaces its predecessor. */
export function onCursor(figure, listener) {
  listeners.set(figure, listener);
  listener(instant);
}

export function moveCursor(t) {
  instant = t;
  for (const listener of listeners.values()) listener(t);
}

export const cursor = () => instant;

/** Returns the index of the value in ascending `times` that is nearest to `t`. */
export function nearest(times, t) {
  const after = Math.min(bisectLeft(times, t), times.length - 1);
  return after > 0 && t - times[after - 1] < times[after] - t ? after - 1 : after;
}
