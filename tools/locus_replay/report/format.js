// SPDX-License-Identifier: Apache-2.0
// Formats of figures: significant digits only, with units that suit their size.
import {format} from "d3-format";

const kThinSpace = "\u202f";

export const count = (value) => format(",d")(value).replace(/,/g, kThinSpace);

/** Formats with that many decimals; zero has no sign. */
export const fixed = (value, digits) => value.toFixed(digits).replace(/^-(?=[0.]*$)/, "").replace("-", "−");

/** Formats with about three digits. */
export function figure(value) {
  if (!Number.isFinite(value)) return "–";
  const size = Math.abs(value);
  if (size === 0) return "0";
  if (size >= 999.5) return count(value);
  return fixed(value, size >= 99.95 ? 0 : size >= 9.995 ? 1 : size >= 0.9995 ? 2 : 3);
}

/** Returns the unit in which lengths up to this one read well. */
export function lengthUnit(largest_m) {
  if (largest_m < 0.1) return {name: "mm", perMetre: 1e3};
  return largest_m < 2e4 ? {name: "m", perMetre: 1} : {name: "km", perMetre: 1e-3};
}

/** 75.2 → "1:15"; tenths for durations below ten seconds. */
export function clock(seconds, tenths = false) {
  const rest = seconds % 60, minutes = Math.floor(seconds / 60) % 60, hours = Math.floor(seconds / 3600);
  const two = (value) => (value < 10 ? "0" : "") + value;
  const secondsText = tenths ? rest.toFixed(1) : String(Math.floor(rest));
  const padded = rest < (tenths ? 9.95 : 10) ? "0" + secondsText : secondsText;
  return hours > 0 ? `${hours}:${two(minutes)}:${padded}` : `${minutes}:${padded}`;
}

/** "90.0" "s", "12:05" "min", "1:00" "h". */
export function duration(seconds) {
  if (seconds < 100) return {value: figure(seconds), unit: "s"};
  return seconds < 3600 ? {value: clock(Math.round(seconds)), unit: "min"} :
                          {value: clock(Math.round(seconds / 60)), unit: "h"};
}

/** Returns round instants in a span of time, about `wanted` of them. */
export function timeTicks(begin_s, end_s, wanted) {
  const steps = [0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 14400, 43200];
  const step = steps.find((candidate) => (end_s - begin_s) / candidate <= wanted) ?? 86400;
  const first = Math.ceil(begin_s / step - 1e-9), last = Math.floor(end_s / step + 1e-9);
  return Array.from({length: last - first + 1}, (_, i) => (first + i) * step);
}

/** Shortens a user-chosen name so that it does not overlap its neighbours. */
export const shortened = (name, length) => (name.length > length ? name.slice(0, length - 1) + "…" : name);
