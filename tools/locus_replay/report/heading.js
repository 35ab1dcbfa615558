// SPDX-License-Identifier: Apache-2.0
// Description of the run, and the few figures that summarise it.
import {select} from "d3-selection";

import {count, duration, figure as written, lengthUnit} from "./format.js";
import {run, summary} from "./run.js";

export function heading() {
  const name = summary.capture.replace(/\/+$/, "").split("/").pop() || summary.capture;
  document.title = `${name} – locus-replay`;
  select("#capture").text(name);
  select("#about").text([summary.capture !== name ? summary.capture : "", recordedAt()].filter(Boolean).join(" · "));
  select("#machine").text(machine());
  const item = select("#key-figures").selectAll("div").data(keyFigures()).join("div");
  item.append("dt").text(({name}) => name);
  const value = item.append("dd");
  value.append("span")
      .attr("class", "value")
      .classed("warning", ({warning}) => warning)
      .text(({value}) => value)
      .append("span")
      .attr("class", "unit")
      .text(({unit}) => (unit ? `\u202f${unit}` : ""));
  value.append("span").attr("class", "detail").text(({detail}) => detail);
}

function recordedAt() {
  if (run.begin_unix_s === undefined) return "";
  return `recorded ${new Date(1e3 * run.begin_unix_s).toISOString().slice(0, 16).replace("T", " ")} UTC`;
}

function machine() {
  const {version, isa, threads, wall_s, cpu_s, peak_rss_mb, config_sha256} = summary;
  return `locus-replay ${version}, ${threads} ${threads === 1 ? "thread" : "threads"}, ${isa}; ${
             written(wall_s)} s of wall clock, ` +
      `${written(cpu_s)} s of CPU, ${written(peak_rss_mb)} MB at most; configuration ${config_sha256.slice(0, 12)}`;
}

function keyFigures() {
  const {sweeps, packets, process_ms, duration_s, wall_s} = summary;
  const lost = packets.total.received > 0 ? `; ${count(packets.total.lost)} packets lost` : "";
  const lost_of = `of ${count(sweeps.seen)} sweeps${lost}`;
  return [
    ...wayFigures(),
    {name: "Recording", ...duration(duration_s), detail: `${written(duration_s / wall_s)} × real time`},
    {
      name: "Per sweep",
      value: written(process_ms.p50),
      unit: "ms",
      detail: `99 % within ${written(process_ms.p99)} ms`
    },
    {name: "Dropped", value: count(sweeps.dropped), detail: lost_of, warning: sweeps.dropped > 0},
    {
      name: "Not registered",
      value: count(sweeps.failed),
      detail: "sweeps; their pose is the prediction",
      warning: sweeps.failed > 0
    },
  ];
}

/** Path length, with the error against the truth or else the estimated uncertainty. */
function wayFigures() {
  if (!run.path) return [];
  const {rpe_10m_percent, end_drift_m} = summary;
  const end_m = ["x", "y", "z"].map((axis) => written(run.path[axis].at(-1))).join(", ");
  const figures = [{name: "Path", ...length(run.path_m), detail: `ends at ${end_m} m`}];
  if (run.ape_m) {
    const {ape_m} = run;
    const unit = lengthUnit(ape_m.max), in_unit = (metres) => written(metres * unit.perMetre);
    figures.push({
      name: "Position error, mean",
      value: in_unit(ape_m.mean),
      unit: unit.name,
      detail: `rms ${in_unit(ape_m.rmse)}, largest ${in_unit(ape_m.max)} ${unit.name}`
    });
    if (Number.isFinite(rpe_10m_percent))
      figures.push({
        name: "Error over 10 m",
        value: written(rpe_10m_percent),
        unit: "%",
        detail: `${written(end_drift_m)} m at the end`
      });
  } else {
    figures.push({
      name: "Standard deviation",
      ...length(run.series.std_m.v.at(-1)),
      detail: "of the last position; no truth given"
    });
  }
  return figures;
}

function length(metres) {
  const unit = lengthUnit(metres);
  return {value: written(metres * unit.perMetre), unit: unit.name};
}
