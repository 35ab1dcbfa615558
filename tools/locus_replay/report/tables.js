// SPDX-License-Identifier: Apache-2.0
// Tables of the report: cost of each stage, input of the lidars, sweeps, sources, configuration.
import {max} from "d3-array";
import {scaleLinear} from "d3-scale";
import {select} from "d3-selection";

import {legend} from "./drawing.js";
import {count, figure as written} from "./format.js";
import {run, summary} from "./run.js";
import {mishap, table} from "./table.js";

const words = (key) => key.replace(/_/g, " ");

export function stages(figure) {
  const drawing = figure.select(".drawing").html("");
  const kQuantiles = ["p50", "p90", "p99", "max"];
  const rows = Object.entries(run.stages ?? {}).map(([name, took]) => ({name: words(name), took}));
  rows.push(
      {name: "cut to estimate, CPU", took: summary.process_cpu_ms, total: true},
      {name: "cut to estimate, wall clock", took: summary.process_ms});
  const {head, rows: row} = table(
      drawing, ["CPU time, ms", "mean", ...kQuantiles],
      rows.map(
          ({name, took}) =>
              [name, took.mean === undefined ? "" : written(took.mean),
               ...kQuantiles.map((key) => written(took[key]))]));
  head.append("th").attr("class", "graph");
  row.classed("total", (_, i) => rows[i].total);
  const scale = scaleLinear([0, 100]).domain([0, max(rows, ({took}) => took.p99) || 1]);
  row.append("td")
      .attr("class", "graph")
      .append("svg")
      .attr("class", "quantiles")
      .attr("aria-hidden", "true")
      .each(function(_, i) {
        drawQuantiles(select(this), rows[i].took, scale);
      });
  legend(figure, [
    {
      name: "median",
      draw: (svg) => svg.append("circle").attr("r", 3.5).attr("cx", 11).attr("cy", 6).attr("class", "mean")
    },
    {
      name: "90 % and 99 % of the sweeps",
      draw: (svg) => svg.append("path").attr("class", "whisker").attr("d", "M2,6H20M12,2V10M20,2V10")
    }
  ]);
}

function drawQuantiles(svg, {p50, p90, p99}, scale) {
  const percent = (value) => `${scale(value)}%`;
  svg.append("line").attr("x1", percent(p50)).attr("x2", percent(p99)).attr("y1", "50%").attr("y2", "50%");
  for (const value of [p90, p99])
    svg.append("line")
        .attr("class", "mark")
        .attr("x1", percent(value))
        .attr("x2", percent(value))
        .attr("y1", "22%")
        .attr("y2", "78%");
  svg.append("circle").attr("r", 3.5).attr("cx", percent(p50)).attr("cy", "50%");
}

/** Draws what the lidars sent: packets, clouds or both. */
export function input(section) {
  const drawing = section.select(".drawing").html("");
  const {total, ...lidars} = summary.packets;
  const ofPackets = Object.entries(lidars);
  const ofClouds = Object.entries(summary.lidars).filter(([, {clouds}]) => clouds);
  if (ofPackets.length > 0) packets(drawing, ofPackets, total);
  if (ofClouds.length > 0) clouds(drawing, ofClouds);
}

function packets(drawing, columns, total) {
  if (columns.length > 1) columns.push(["all", total]);
  const row = (name, write) => [name, ...columns.map(([, counters]) => write(counters))];
  const rejections = Object.keys(total.rejected).filter((reason) => total.rejected[reason] > 0);
  table(drawing, ["", ...columns.map(([name]) => name)], [
    ["model", ...columns.map(([lidar]) => summary.lidars[lidar]?.model ?? "")],
    ...["received", "data", "position"].map((key) => row(key, (counters) => count(counters[key]))),
    ...["lost", "reordered", "clock_steps"].map((key) => row(words(key), (counters) => mishap(counters[key]))),
    ...rejections.map((reason) => row(`rejected: ${words(reason)}`, (counters) => mishap(counters.rejected[reason]))),
  ]);
  if (rejections.length === 0) drawing.append("p").attr("class", "note").text("No packet was rejected.");
}

function clouds(drawing, columns) {
  const row = (name, write) => [name, ...columns.map(([, lidar]) => write(lidar.clouds))];
  const refused = (why) => columns.some(([, lidar]) => lidar.clouds.refused[why] > 0);
  const refusals = Object.keys(columns[0][1].clouds.refused).filter(refused);
  table(drawing, ["", ...columns.map(([name]) => name)], [
    ["topic", ...columns.map(([, {topic}]) => topic)],
    row("clouds received", (one) => count(one.received)),
    row("clouds used", (one) => count(one.used)),
    ...refusals.map((why) => row(`refused: ${words(why)}`, (one) => mishap(one.refused[why]))),
    ...["reordered", "clock_steps"].map((key) => row(words(key), (one) => mishap(one[key]))),
    row("points", (one) => count(one.points)),
    row("times of points", (one) => one.times),
    row("rings", (one) => one.rings),
  ]);
}

export function sources(section) {
  const drawing = section.select(".drawing").html("");
  const {sweeps, points, iterations_mean: iterations} = summary;
  table(
      drawing, ["sweeps", "seen", "processed", "dropped", "failed"],
      [["", count(sweeps.seen), count(sweeps.processed), mishap(sweeps.dropped), mishap(sweeps.failed)]]);
  table(drawing, ["mean per sweep", ""], [
    ["returns", count(Math.round(points.raw_mean))],
    ["points registered", count(Math.round(points.filtered_mean))],
    ["iterations, scan to scan", written(iterations.scan_to_scan)],
    ["iterations, scan to submap", written(iterations.scan_to_submap)],
  ]);
  const rejections = (rejected) => Object.entries(rejected).filter(([, times]) => times > 0);
  table(
      drawing, ["source", "samples", "used in sweeps", "changes of health", "rejected"],
      Object.entries(summary.sources).map(([name, source]) => {
        const reasons = rejections(source.rejected).map(([reason, times]) => `${words(reason)} ${count(times)}`);
        if (source.verdict) {
          reasons.push(source.verdict);
        }
        if (source.calibration_warning) {
          reasons.push(source.calibration_warning);
        }
        return [
          name, count(source.received), count(source.used_sweeps), mishap(source.health_changes),
          reasons.length > 0 ? {text: `▲ ${reasons.join(", ")}`, warning: true} : "none"
        ];
      }));
}

export function configuration(section) {
  section.select(".drawing").html("").append("pre").text(run.config);
}
