// SPDX-License-Identifier: Apache-2.0
// Figures of the status: heading, ellipse of the position, motion sources, lidars.
import {select} from "d3-selection";

import {canvasOf, legend} from "../../../locus_replay/report/drawing.js";
import {count, duration, figure as written, fixed, lengthUnit} from "../../../locus_replay/report/format.js";
import {mishap, table} from "../../../locus_replay/report/table.js";

import {deviations} from "./covariance.js";

const kCalmStates = ["tracking", "standstill", "waiting"];
const kLate_ms = 1000;
const words = (name) => name.replace(/_/g, " ");
const seconds = (ms) => (ms === null || ms === undefined ? "never" : `${fixed(ms / 1000, 1)} s`);

export function heading(live) {
  const {status, problem} = live;
  const state = problem ? "not connected" : words(status?.state ?? "connecting");
  document.title = `${state} – locusd`;
  select("#state").text(state).classed("warning", problem !== "" || !kCalmStates.includes(status?.state));
  select("#problem").attr("hidden", problem ? null : "").text(problem ? `${problem}. This page reconnects by itself.` : "");
  if (!status) return;
  const up = duration(status.duration_s);
  select("#about").text(`locusd ${status.version}, up ${up.value} ${up.unit}`);
  const item = select("#key-figures").selectAll("div").data(keyFigures(live)).join((enter) => {
    const added = enter.append("div");
    added.append("dt");
    const value = added.append("dd");
    value.append("span").attr("class", "value");
    value.append("span").attr("class", "detail");
    return added;
  });
  item.select("dt").text(({name}) => name);
  item.select(".value").classed("warning", ({warning}) => warning === true).text(({value}) => value);
  item.select(".detail").text(({detail}) => detail);
}

function keyFigures(live) {
  const {status} = live, {sweeps, packets, process_ms, pose} = status;
  const path = lengthUnit(Math.max(live.length_m, 1));
  const lost = packets.total.lost + packets.kernel_drops;
  const unseen = (live.pose?.missed ?? 0) + live.skipped;
  return [
    {
      name: "Position, m",
      value: pose ? pose.xyz_m.map((metres) => fixed(metres, 2)).join("  ") : "–",
      detail: pose ? `heading ${fixed(pose.rpy_deg[2], 1)}°` : "no sweep yet"
    },
    {
      name: "Path",
      value: `${written(live.length_m * path.perMetre)} ${path.name}`,
      detail: "since this view was started"
    },
    {
      name: "Sweeps per second",
      value: fixed(status.rate_hz, 1),
      detail: `last ${seconds(status.age_ms)} ago; ${count(unseen)} not shown here`,
      warning: !(status.age_ms < kLate_ms)
    },
    {name: "Per sweep", value: `${written(process_ms.p50)} ms`, detail: `99 % within ${written(process_ms.p99)} ms`},
    {
      name: "Dropped",
      value: count(sweeps.dropped),
      detail: `of ${count(sweeps.seen)} sweeps; ${count(lost)} packets lost`,
      warning: sweeps.dropped > 0
    },
    {
      name: "Not registered",
      value: count(sweeps.failed),
      detail: "sweeps; their pose is the prediction",
      warning: sweeps.failed > 0
    },
  ];
}

const kEllipseShare = 5.991;  // squared deviations that hold 95 % of a normal distribution in the plane

/** Draws the 95 % ellipse in the plane of the odom frame, x to the right and y up, in a circle of a round radius. */
export function ellipse(figure, {status}) {
  const plane = deviations(status?.covariance, [0, 1]);
  const width = figure.select(".drawing").node().clientWidth, height = 190, reach = height / 2 - 16;
  const svg = canvasOf(figure, width, height, "95 % ellipse of the position");
  if (!plane) return svg.append("text").attr("x", 0).attr("y", 20).text("No estimate yet.");
  const semi_m = plane.sd_m.map((sd) => Math.sqrt(kEllipseShare) * sd);
  const radius_m = roundAbove(1.15 * Math.max(...semi_m, 1e-4)), unit = lengthUnit(radius_m);
  const group = svg.append("g").attr("transform", `translate(${width / 2} ${height / 2})`);
  const pixels_per_m = reach / radius_m;
  for (const share of [0.5, 1]) group.append("circle").attr("class", "ring").attr("r", share * reach);
  group.append("path").attr("class", "ring").attr("d", `M${-reach},0H${reach}M0,${-reach}V${reach}`);
  const [x, y] = plane.axes[0];
  group.append("ellipse")
      .attr("class", "area")
      .attr("rx", Math.max(semi_m[0] * pixels_per_m, 1))
      .attr("ry", Math.max(semi_m[1] * pixels_per_m, 1))
      .attr("transform", `rotate(${-Math.atan2(y, x) * 180 / Math.PI})`);
  group.append("text").attr("x", reach + 6).attr("y", 4).text("x");
  group.append("text").attr("x", -3).attr("y", -reach - 5).text("y");
  svg.append("text").attr("x", 0).attr("y", height - 4).text(`circle: ${written(radius_m * unit.perMetre)} ${unit.name}`);
  const sd = (i) => Math.sqrt(status.covariance[7 * i]) * unit.perMetre;
  svg.append("text")
      .attr("class", "reading")
      .attr("x", width)
      .attr("y", height - 4)
      .attr("text-anchor", "end")
      .text(`σ  ${[0, 1, 2].map((i) => written(sd(i))).join("  ")} ${unit.name}`);
  legend(figure, [{name: "95 %, since the start of the odometry"}]);
}

/** Returns the next of 1, 2 and 5 times a power of ten. */
function roundAbove(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return power * [1, 2, 5, 10].find((factor) => factor * power >= value);
}

export function sources(section, {status}) {
  const drawing = section.select(".drawing").html("");
  const all = Object.entries(status?.sources ?? {});
  if (all.length === 0) return drawing.append("p").attr("class", "note").text("None is configured: lidar alone.");
  const ratios = all.map(([, source]) => source.innovation?.test_ratio);
  const {head, rows} = table(
      drawing, ["source", "health", "used in sweeps", "silent", "test ratio"],
      all.map(
          ([name, source], i) =>
              [name, source.health === "healthy" ? source.health : {text: `▲ ${source.health}`, warning: true},
               count(source.used_sweeps), seconds(source.heard_ms_ago),
               ratios[i] > 1 ? {text: `▲ ${fixed(ratios[i], 2)}`, warning: true} :
                               ratios[i] === undefined ? "–" : fixed(ratios[i], 2)]));
  head.append("th");
  rows.append("td")
      .attr("class", "bar")
      .append("div")
      .append("span")
      .attr("class", (_, i) => (ratios[i] > 1 ? "exceeded" : null))
      .style("width", (_, i) => `${100 * Math.min(ratios[i] ?? 0, 1)}%`);
  for (const [name, source] of all)
    if (source.verdict) drawing.append("p").attr("class", "note warning").text(`${name} ${source.verdict}`);
  drawing.append("p").attr("class", "note").text("Test ratio: above 1 the source is contradicted.");
}

export function lidars(section, {status}) {
  const drawing = section.select(".drawing").html("");
  const all = Object.entries(status?.lidars ?? {});
  const sum = (counts) => Object.values(counts ?? {}).reduce((total, times) => total + times, 0);
  table(
      drawing, ["lidar", "model", "data", "lost", "rejected", "silent"], all.map(([name, lidar]) => {
        const packets = status.packets[name], clouds = lidar.clouds;
        return [
          name, lidar.model ?? (clouds ? "clouds" : "no data"), count(clouds?.used ?? packets?.data ?? 0),
          mishap(clouds?.dropped ?? packets?.lost ?? 0), mishap(sum(clouds?.refused ?? packets?.rejected)),
          seconds(lidar.heard_ms_ago)
        ];
      }));
  for (const [name, lidar] of all)
    if (lidar.problem) drawing.append("p").attr("class", "note warning").text(`${name}: ${lidar.problem}`);
}

/** States how far the memory of the page goes. */
export function bounds({tiles, path}) {
  select("#bounds").text(
      `${count(tiles.count)} of at most ${count(tiles.max)} tiles of ${written(tiles.tile_m)} m; when these are used up, ` +
      `larger tiles replace them. Tiles show everything observed, including objects that have moved since.`);
}
