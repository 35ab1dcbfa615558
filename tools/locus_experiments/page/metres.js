// SPDX-License-Identifier: Apache-2.0
import {scaleLog} from "d3-scale";

/** Returns a logarithmic scale of errors in metres, with a tick at each power of ten, from 0.1 mm. */
export function metreScale(least_m, most_m, range) {
  const lowest = Math.max(1e-4, least_m);
  const scale = scaleLog(range).domain([lowest, Math.max(10 * lowest, most_m)]).nice();
  const [first, last] = scale.domain().map((value) => Math.round(Math.log10(value)));
  const ticks = Array.from({length: last - first + 1}, (_, i) => 10 ** (first + i));
  const metres = (value) => (value < 0.9 ? `${Math.round(1e4 * value) / 10} mm` : `${Math.round(value)} m`);
  const clamped = (value) => scale(Math.max(value, scale.domain()[0]));
  const {domain, range: extent, copy} = scale; // interface that an axis needs
  return Object.assign(clamped, {domain, range: extent, copy, ticks: () => ticks, tickFormat: () => metres});
}
