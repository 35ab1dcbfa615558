// SPDX-License-Identifier: Apache-2.0
// Path and truth from above and from the side, over the walls of the map.
import {extent, quantile} from "d3-array";
import {scaleLinear} from "d3-scale";
import {line} from "d3-shape";

import {nearest, onCursor} from "./cursor.js";
import {bottomAxis, canvasOf, colour, leftAxis, legend, lineSample} from "./drawing.js";
import {map, run} from "./run.js";

const kMargin = {
  top: 8,
  right: 8,
  bottom: 36,
  left: 48
};
const kAxes = ["x", "y", "z"];

/** Projections of the odom frame: one axis across the page, one up. */
export function plan(figure, width) {
  const across = extentOfPaths("x"), up = extentOfPaths("y");
  const view = {across: withWalls("x", across, up), up: withWalls("y", up, across)};
  const height = document.querySelector("#map .drawing").clientHeight;  // height of the neighbouring figure
  const field_height = height - kMargin.top - kMargin.bottom;
  draw(figure, {width, field_height, axes: ["x", "y"], view, exaggeration: 1, name: "Path from above"});
}

export function side(figure, width) {
  const length = ([low, high]) => high - low;
  const [x, y] = [extentOfPaths("x"), extentOfPaths("y")];
  const axis = length(y) > length(x) ? "y" : "x";
  const view = {
    across: axis === "x" ? withWalls("x", x, y) : withWalls("y", y, x),
    up: widened(extentOfPaths("z"), 0.25)
  };
  const field_width = width - kMargin.left - kMargin.right, field_height = 0.36 * field_width;
  const fitting = field_height / length(view.up) / (field_width / length(view.across));
  const exaggeration = [200, 100, 50, 20, 10, 5, 2].find((factor) => factor <= fitting) ?? 1;
  draw(figure, {width, field_height, axes: [axis, "z"], view, exaggeration, name: "Path from the side"});
}

const paths = () => (run.truth ? [run.path, run.truth] : [run.path]);
const extentOfPaths = (axis) => extent(paths().flatMap((path) => extent(path[axis])));

function widened([low, high], by) {
  return [low - by, high + by];
}

/** Widens the axis to the surrounding walls, by at most the larger extent of the path. */
function withWalls(axis, along, across) {
  const room = Math.max(along[1] - along[0], across[1] - across[0], 6);
  const coordinates =
      Array.from({length: map.count}, (_, i) => map.centres[3 * i + kAxes.indexOf(axis)]).sort((a, b) => a - b);
  const walls = map.count > 0 ? [quantile(coordinates, 0.01), quantile(coordinates, 0.99)] : along;
  return widened(
      [
        Math.min(along[0], Math.max(walls[0], along[0] - room)), Math.max(along[1], Math.min(walls[1], along[1] + room))
      ],
      0.03 * room);
}

/** Sets both scales equal except for the exaggeration, with the view in the middle. */
function scales({width, field_height, view, exaggeration}) {
  const field_width = width - kMargin.left - kMargin.right;
  const middle = ([low, high]) => (low + high) / 2;
  const pixels_per_m = Math.min(
      field_width / (view.across[1] - view.across[0]), field_height / (view.up[1] - view.up[0]) / exaggeration);
  const half_across_m = field_width / pixels_per_m / 2, half_up_m = field_height / pixels_per_m / exaggeration / 2;
  return {
    across: scaleLinear([kMargin.left, kMargin.left + field_width]).domain([
      middle(view.across) - half_across_m, middle(view.across) + half_across_m
    ]),
    up: scaleLinear([kMargin.top + field_height, kMargin.top]).domain([
      middle(view.up) - half_up_m, middle(view.up) + half_up_m
    ]),
  };
}

function draw(figure, options) {
  const {width, field_height, axes, exaggeration, name} = options;
  const height = field_height + kMargin.top + kMargin.bottom;
  const {across, up} = scales(options);
  drawWalls(figure, {width, height, axes, across, up, exaggeration});

  const svg = canvasOf(figure, width, height, name);
  bottomAxis(svg, across, {y: kMargin.top + field_height, height: field_height, ticks: across.ticks(width / 90)});
  leftAxis(svg, up, {x: kMargin.left, width: width - kMargin.left - kMargin.right, count: field_height / 50});
  svg.append("text")
      .attr("class", "unit")
      .attr("x", width - kMargin.right)
      .attr("y", height - 4)
      .attr("text-anchor", "end")
      .text(`${axes[0]} in m`);
  svg.append("text")
      .attr("class", "unit")
      .attr("x", 0)
      .attr("y", height - 4)
      .text(exaggeration > 1 ? `${axes[1]} in m, exaggerated ${exaggeration} times` : `${axes[1]} in m`);

  const at = (path, i) => [across(path[axes[0]][i]), up(path[axes[1]][i])];
  const curve = (path) => line()(path.t.map((_, i) => at(path, i)));
  if (run.truth) svg.append("path").attr("class", "truth").attr("d", curve(run.truth));
  svg.append("path").attr("class", "estimate").attr("d", curve(run.path));
  drawEnds(svg, at(run.path, 0), at(run.path, run.path.t.length - 1));
  drawCursor(svg, name, (t) => at(run.path, nearest(run.path.t, t)));
  describe(figure);
}

function drawEnds(svg, begin, end) {
  const below = end[1] > begin[1] ? {begin: -9, end: 18} : {begin: 18, end: -9};
  svg.append("circle").attr("class", "end").attr("r", 4.5).attr("cx", begin[0]).attr("cy", begin[1]);
  svg.append("rect")
      .attr("class", "end")
      .attr("width", 8)
      .attr("height", 8)
      .attr("x", end[0] - 4)
      .attr("y", end[1] - 4);
  svg.append("text")
      .attr("class", "end-label")
      .attr("x", begin[0])
      .attr("y", begin[1] + below.begin)
      .attr("text-anchor", "middle")
      .text("start");
  svg.append("text")
      .attr("class", "end-label")
      .attr("x", end[0])
      .attr("y", end[1] + below.end)
      .attr("text-anchor", "middle")
      .text("end");
}

function drawCursor(svg, name, at) {
  const here = svg.append("circle").attr("class", "here").attr("r", 5);
  onCursor(name, (t) => {
    here.attr("display", t === null ? "none" : null);
    if (t !== null) here.attr("cx", at(t)[0]).attr("cy", at(t)[1]);
  });
}

/** Collects the edge of every tile that is seen edge-on. */
function drawWalls(figure, {width, height, axes, across, up, exaggeration}) {
  const drawing = figure.select(".drawing");
  drawing.selectAll("canvas").remove();
  const pixels = window.devicePixelRatio || 1;
  const canvas = drawing.insert("canvas", ":first-child")
                     .attr("width", width * pixels)
                     .attr("height", height * pixels)
                     .style("width", `${width}px`)
                     .style("height", `${height}px`)
                     .attr("aria-hidden", "true");
  if (exaggeration > 2) return;
  const context = canvas.node().getContext("2d");
  context.scale(pixels, pixels);
  context.beginPath();
  context.rect(across.range()[0], up.range()[1], across.range()[1] - across.range()[0], up.range()[0] - up.range()[1]);
  context.clip();
  context.strokeStyle = colour("wall");
  context.globalAlpha = 0.8;
  context.lineWidth = 1.25;
  context.beginPath();
  const [a, b] = axes.map((axis) => kAxes.indexOf(axis));
  for (let i = 0; i < 3 * map.count; i += 3) {
    const [na, nb] = [map.normals[i + a], map.normals[i + b]];
    const edge_on = Math.hypot(na, nb);
    if (edge_on < 0.8) continue;
    const half_m = map.tile_m / 2 / edge_on;
    const [ca, cb] = [map.centres[i + a], map.centres[i + b]];
    context.moveTo(across(ca - nb * half_m), up(cb + na * half_m));
    context.lineTo(across(ca + nb * half_m), up(cb - na * half_m));
  }
  context.stroke();
}

function describe(figure) {
  const entries = [{name: "estimate", draw: lineSample("estimate")}];
  if (run.truth) entries.push({name: "truth", draw: lineSample("truth")});
  legend(figure, entries);
}
