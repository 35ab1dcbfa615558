// SPDX-License-Identifier: Apache-2.0
// Error, deviation, speed and cost over time, and below them the state of the odometry and the health of its sources.
import {max} from "d3-array";
import {scaleLinear} from "d3-scale";
import {select} from "d3-selection";
import {line} from "d3-shape";

import {cursor, moveCursor, nearest, onCursor} from "./cursor.js";
import {bottomAxis, canvasOf, leftAxis, legend} from "./drawing.js";
import {clock, figure as written, lengthUnit, shortened, timeTicks} from "./format.js";
import {begin_s, end_s, run, summary} from "./run.js";

const kMargin = {
  top: 6,
  right: 10,
  bottom: 30,
  left: 64
};
const kPanel = {
  height: 88,
  gap: 18,
  title: 18
};
const kBand = {
  height: 14,
  pitch: 22
};

const kStates = ["dead reckoning", "degenerate", "standstill", "tracking"];  // worst first, as in report.cpp
const kHealth = ["lost", "healthy, not used", "used"];

export function timeline(figure, width) {
  const panels = panelsOfRun(),
        bands = [{...run.state, what_names: kStates}, ...run.health.map((band) => ({...band, what_names: kHealth}))];
  const bands_top = kMargin.top + panels.length * (kPanel.title + kPanel.height + kPanel.gap);
  const bottom = bands_top + bands.length * kBand.pitch;
  const svg = canvasOf(
      figure, width, bottom + kMargin.bottom, "Error, deviation, speed and cost over time, and health of the sources");
  const shown_s = Math.max(end_s - begin_s, run.period_s, 1e-3);
  const x = scaleLinear([kMargin.left, width - kMargin.right]).domain([begin_s, begin_s + shown_s]);

  bottomAxis(svg, x, {
    y: bottom,
    height: bottom - kMargin.top,
    ticks: timeTicks(begin_s, end_s, width / 80),
    format: (t) => (end_s < 10 ? `${written(t)} s` : clock(t))
  });
  const readings = panels.map(
      (panel, i) =>
          drawPanel(svg, panel, x, kMargin.top + i * (kPanel.title + kPanel.height + kPanel.gap) + kPanel.title));
  definePatterns(svg);
  readings.push(...bands.map((band, i) => drawBand(svg, band, x, bands_top + i * kBand.pitch)));
  drawCursor(svg, x, bottom, readings);
  describe(figure);
}

function panelsOfRun() {
  const {error_m, std_m, speed_mps, process_ms} = run.series;
  const panels = [];
  if (error_m) panels.push(lengthPanel("Position error", error_m));
  panels.push(lengthPanel("Standard deviation of the position", std_m));
  panels.push({name: "Speed", unit: "m/s", series: speed_mps, factor: 1});
  panels.push({
    name: "Time per sweep, cut to estimate",
    unit: "ms",
    series: process_ms,
    factor: 1,
    limit: {value: 1e3 * run.period_s, name: "one sweep"}
  });
  return panels;
}

function lengthPanel(name, series) {
  const unit = lengthUnit(max(series.v) ?? 0);
  return {name, unit: unit.name, series, factor: unit.perMetre};
}

/** Draws a panel; returns a function that shows the value at a time. */
function drawPanel(svg, {name, unit, series, factor, limit}, x, top) {
  const values = series.v.map((value) => value * factor);
  const largest = max(values) || 1;
  const y = scaleLinear([top + kPanel.height, top]).domain([0, 1.05 * largest]);
  leftAxis(svg, y, {x: kMargin.left, width: x.range()[1] - kMargin.left, count: 4});
  svg.append("text").attr("class", "title").attr("x", kMargin.left).attr("y", top - 7).text(`${name}, ${unit}`);
  if (limit && limit.value < y.domain()[1]) {
    svg.append("line")
        .attr("class", "limit")
        .attr("x1", x.range()[0])
        .attr("x2", x.range()[1])
        .attr("y1", y(limit.value))
        .attr("y2", y(limit.value));
    svg.append("text")
        .attr("x", x.range()[1])
        .attr("y", y(limit.value) - 4)
        .attr("text-anchor", "end")
        .text(limit.name);
  }
  svg.append("path").attr("class", "series").attr("d", line()(series.t.map((t, i) => [x(t), y(values[i])])));
  const reading =
      svg.append("text").attr("class", "reading").attr("x", x.range()[1]).attr("y", top - 7).attr("text-anchor", "end");
  return (t) =>
             reading.text(t === null || values.length === 0 ? "" : `${written(values[nearest(series.t, t)])} ${unit}`);
}

function drawBand(svg, {name, t, what, what_names}, x, top) {
  const group = svg.append("g").attr("class", "band");
  group.append("text")
      .attr("x", kMargin.left - 8)
      .attr("y", top + kBand.height - 3)
      .attr("text-anchor", "end")
      .text(shortened(name, 9))
      .append("title")
      .text(name);
  if (summary.sources[name]?.received === 0) {
    group.append("text").attr("x", kMargin.left + 6).attr("y", top + kBand.height - 3).text("no sample received");
    return () => {};
  }
  group.selectAll("rect").data(what).join("rect").each(function(state, i) {
    const begin = x(t[i]), end = x(i + 1 < t.length ? t[i + 1] : x.domain()[1]);
    paint(select(this), what_names[state], top).attr("x", begin).attr("width", Math.max(end - begin, 1));
  });
  const reading = group.append("text").attr("class", "reading end-label").attr("y", top + kBand.height - 3);
  return (at) => {
    reading.text(at === null ? "" : what_names[what[lastBefore(t, at)]]);
    if (at !== null) {
      const right_half = x(at) > (x.range()[0] + x.range()[1]) / 2;
      reading.attr("x", x(at) + (right_half ? -6 : 6)).attr("text-anchor", right_half ? "end" : "start");
    }
  };
}

function lastBefore(times, t) {
  const i = nearest(times, t);
  return times[i] > t && i > 0 ? i - 1 : i;
}

/** Patterns of states: good ones are solid or thin, bad ones hatched, distinguishable without colour. */
function paint(rect, name, top) {
  const looks = {
    "used": {fill: "var(--estimate)"},
    "healthy, not used": {fill: "var(--estimate)", thin: true},
    "lost": {fill: "url(#hatched)"},
    "tracking": {fill: "var(--wall)"},
    "standstill": {fill: "var(--wall)", thin: true},
    "degenerate": {fill: "url(#dotted)"},
    "dead reckoning": {fill: "url(#hatched)"},
  }[name];
  const height = looks.thin ? 3 : kBand.height;
  return rect.attr("data-what", name)
      .attr("fill", looks.fill)
      .attr("height", height)
      .attr("y", top + (kBand.height - height) / 2);
}

function definePatterns(svg) {
  const defs = svg.append("defs");
  const pattern = (id) =>
      defs.append("pattern").attr("id", id).attr("width", 5).attr("height", 5).attr("patternUnits", "userSpaceOnUse");
  const hatched = pattern("hatched").attr("patternTransform", "rotate(45)");
  hatched.append("rect").attr("width", 2.5).attr("height", 5).attr("fill", "var(--warning)");
  const dotted = pattern("dotted");
  dotted.append("circle").attr("cx", 2.5).attr("cy", 2.5).attr("r", 1.6).attr("fill", "var(--warning)");
}

function drawCursor(svg, x, bottom, readings) {
  const rule = svg.append("line").attr("class", "cursor").attr("y1", kMargin.top).attr("y2", bottom);
  const time =
      svg.append("text").attr("class", "reading end-label").attr("y", bottom + 18).attr("text-anchor", "middle");
  onCursor("timeline", (t) => {
    for (const element of [rule, time]) element.attr("display", t === null ? "none" : null);
    if (t !== null) {
      rule.attr("x1", x(t)).attr("x2", x(t));
      time.attr("x", x(t)).text(clock(t, true));
    }
    for (const read of readings) read(t);
  });

  const within = (t) => Math.min(Math.max(t, begin_s), end_s);
  svg.attr("tabindex", 0).node().addEventListener("pointermove", (event) => {
    const box = svg.node().getBoundingClientRect();
    moveCursor(within(x.invert(event.clientX - box.left)));
  });
  svg.node().addEventListener("pointerleave", () => moveCursor(null));
  svg.node().addEventListener("keydown", (event) => {
    const step = {ArrowLeft: -1, ArrowRight: 1}[event.key];
    if (step)
      moveCursor(within((cursor() ?? begin_s) + step * (end_s - begin_s) / 200));
    else if (event.key === "Escape")
      moveCursor(null);
    else
      return;
    event.preventDefault();
  });
}

function describe(figure) {
  const sample = (name) => (svg) => {
    const rect = paint(svg.append("rect"), name, 0).attr("width", 20);
    rect.attr("y", (12 - rect.attr("height")) / 2);
  };
  const present = new Set(figure.selectAll(".band rect").nodes().map((rect) => rect.dataset.what));
  legend(figure, [...kStates, ...kHealth].reverse().filter((name) => present.has(name)).map((name) => ({
                                                                                              name,
                                                                                              draw: sample(name)
                                                                                            })));
}
