// SPDX-License-Identifier: Apache-2.0
// Drawing functions common to the figures.
import {axisBottom, axisLeft} from "d3-axis";
import {select} from "d3-selection";

/** Puts an empty SVG of that size into the figure, replacing its predecessor. */
export function canvasOf(figure, width, height, description) {
  const drawing = figure.select(".drawing");
  drawing.selectAll("svg").remove();
  return drawing.append("svg")
      .attr("viewBox", `0 0 ${width} ${height}`)
      .attr("height", height)
      .attr("role", "img")
      .attr("aria-label", description);
}

/** Redraws when the width of the page changes. */
export function onNewWidth(draw) {
  let drawn_width = window.innerWidth;
  window.addEventListener("resize", () => {
    if (window.innerWidth === drawn_width) return;  // a phone's address bar changes the height only
    drawn_width = window.innerWidth;
    draw();
  });
}

const withMinus = (format) => (value) => format(value).replace("-", "−");

/** Draws an axis along the bottom of a field, with a grid as tall as the field. */
export function bottomAxis(svg, scale, {y, height, ticks, format}) {
  const axis = axisBottom(scale).tickSizeInner(-height).tickSizeOuter(0).tickPadding(6);
  if (ticks) axis.tickValues(ticks);
  axis.tickFormat(format ?? withMinus(scale.tickFormat()));
  svg.append("g").attr("class", "axis grid").attr("transform", `translate(0 ${y})`).call(axis);
}

/** Draws an axis along the left of a field, with a grid as wide as the field. */
export function leftAxis(svg, scale, {x, width, count}) {
  const axis = axisLeft(scale).tickSizeInner(-width).tickSizeOuter(0).tickPadding(6).ticks(count).tickFormat(
      withMinus(scale.tickFormat(count)));
  svg.append("g").attr("class", "axis grid").attr("transform", `translate(${x} 0)`).call(axis);
}

/** Draws a legend: samples with their names; `draw` gets an SVG of 22 by 12. */
export function legend(figure, entries) {
  const items = figure.select(".legend").html("").selectAll("span").data(entries).join("span");
  items.each(function({name, draw}) {
    const item = select(this);
    if (draw) item.append("svg").attr("width", 22).attr("height", 12).attr("aria-hidden", "true").call(draw);
    item.append("span").text(name);
  });
}

export const lineSample = (className) => (svg) =>
    svg.append("line").attr("class", className).attr("x1", 1).attr("x2", 21).attr("y1", 6).attr("y2", 6);

/** Shows an unobtrusive sentence instead of a figure. */
export function note(figure, sentence) {
  figure.select(".drawing").html("").append("p").attr("class", "note").text(sentence);
}

/** Returns a custom CSS property of the page, for drawings outside the style sheet. */
export const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
