// SPDX-License-Identifier: Apache-2.0
// Table II and the paper's box plots: errors of each run relative to the truth.
import {max, min} from "d3-array";
import {scaleBand} from "d3-scale";

import {bottomAxis, canvasOf, legend} from "../../locus_replay/report/drawing.js";
import {figure as written} from "../../locus_replay/report/format.js";
import {metreScale} from "./metres.js";
import {accuracy as paper} from "./paper.js";
import {configurations, courseName, courses, find} from "./results.js";
import {metres, missing, table} from "./table.js";

const compared = courses.filter((course) =>
    Object.keys(configurations).some((key) => find(course, key)?.summary.ape_m));

function ourRow(run, name) {
  const {ape_m: ape, map_error_m: map, rpe_10m_percent: rpe} = run.summary;
  return {className: "ours", cells: [name, metres(ape.max), metres(ape.mean), metres(ape.std),
      typeof map?.rmse === "number" ? metres(map.rmse) : "–", typeof rpe === "number" ? written(rpe) : "–"]};
}

export function accuracyTable(section) {
  const groups = compared.map((course) => {
    const theirs = paper[course]?.rows ?? [];
    const ours = Object.entries(configurations).filter(([key]) => find(course, key)?.summary.ape_m);
    return {
      name: courseName(course),
      rows: [...theirs.map(({name, ape, map}) =>
                 ({cells: [`paper: ${name}`, ...ape.map(written), written(map), "–"]})),
             ...ours.map(([key, name]) => ourRow(find(course, key), name))],
    };
  });
  table(section.select(".drawing").html(""),
        ["", "max APE, m", "mean", "std", "map RMSE, m", "drift over 10 m, %"], groups);
}

const kMargin = {top: 4, right: 24, bottom: 30, left: 24}, kRow = 22, kLabel = 17;

/** Draws a box per run, on a common logarithmic scale. */
export function boxes(figure, width) {
  const rows = compared.flatMap((course) => Object.keys(configurations)
      .filter((key) => find(course, key)?.position_error)
      .map((key) => ({course, key, box: find(course, key).position_error_quantiles_m})));
  const height = rows.length * (kRow + kLabel) + kMargin.top + kMargin.bottom;
  const svg = canvasOf(figure, width, height, "Position errors of each run");
  const x = metreScale(min(rows, ({box}) => box.p1), max(rows, ({box}) => box.max),
                       [kMargin.left, width - kMargin.right]);
  const y = scaleBand([kMargin.top, height - kMargin.bottom]).domain(rows.map((_, i) => i));
  bottomAxis(svg, x, {y: height - kMargin.bottom, height: height - kMargin.bottom - kMargin.top});
  rows.forEach((row, i) => drawBox(svg, row, y(i), x));
  legend(figure, ["box: half of the sweeps", "line: 98 %", "dot: the largest"].map((name) => ({name})));
}

function drawBox(svg, {course, key, box}, top, x) {
  const middle = top + kLabel + kRow / 2;
  svg.append("text").attr("x", 0).attr("y", top + kLabel - 4).text(`${courseName(course)}: ${configurations[key]}`);
  const group = svg.append("g").attr("class", "box-plot");
  group.append("line").attr("class", "whisker").attr("x1", x(box.p1)).attr("x2", x(box.p99))
      .attr("y1", middle).attr("y2", middle);
  group.append("rect").attr("class", "box").attr("x", x(box.q1)).attr("width", Math.max(1, x(box.q3) - x(box.q1)))
      .attr("y", middle - 6).attr("height", 12);
  group.append("line").attr("class", "median").attr("x1", x(box.median)).attr("x2", x(box.median))
      .attr("y1", middle - 6).attr("y2", middle + 6);
  group.append("circle").attr("class", "largest").attr("r", 2.75).attr("cx", x(box.max)).attr("cy", middle);
}
