// SPDX-License-Identifier: Apache-2.0
// Distribution of the position errors, over the run and over each fifth of it.
import {max} from "d3-array";
import {scaleBand, scaleLinear} from "d3-scale";

import {canvasOf, leftAxis, legend, note} from "./drawing.js";
import {figure as written, lengthUnit} from "./format.js";
import {run} from "./run.js";

const kMargin = {
  top: 8,
  right: 8,
  bottom: 30,
  left: 48
};

export function boxes(figure, width) {
  if (!run.error_boxes) {
    note(
        figure,
        "This recording has no true trajectory, so the error of the estimate is unknown. " +
            "Name one with --ground-truth FILE, or put it beside the capture as gt.tum.");
    return;
  }
  const height = Math.max(0.36 * width, 200);
  const largest_m = max(run.error_boxes, (box) => box.max);
  const unit = lengthUnit(largest_m);
  const svg = canvasOf(
      figure, width, height,
      run.error_boxes.map((box) => `${box.name}: median ${written(box.median * unit.perMetre)} ${unit.name}`)
          .join("; "));
  const x =
      scaleBand([kMargin.left, width - kMargin.right]).domain(run.error_boxes.map((box) => box.name)).padding(0.45);
  const y = scaleLinear([height - kMargin.bottom, kMargin.top]).domain([0, 1.05 * largest_m * unit.perMetre]);
  leftAxis(svg, y, {x: kMargin.left, width: width - kMargin.left - kMargin.right, count: 5});
  for (const box of run.error_boxes)
    drawBox(svg, box, x(box.name), x.bandwidth(), (metres) => y(metres * unit.perMetre), height);
  svg.append("text").attr("x", 0).attr("y", height - 6).text(unit.name);
  describe(figure);
}

function drawBox(svg, box, left, width, y, height) {
  const group = svg.append("g").attr("class", "box-plot"), middle = left + width / 2;
  const level = (value, className, share) => group.append("line")
                                                 .attr("class", className)
                                                 .attr("x1", middle - share * width / 2)
                                                 .attr("x2", middle + share * width / 2)
                                                 .attr("y1", y(value))
                                                 .attr("y2", y(value));
  group.append("line")
      .attr("class", "whisker")
      .attr("x1", middle)
      .attr("x2", middle)
      .attr("y1", y(box.p1))
      .attr("y2", y(box.p99));
  level(box.p1, "whisker", 0.4);
  level(box.p99, "whisker", 0.4);
  group.append("rect")
      .attr("class", "box")
      .attr("x", left)
      .attr("width", width)
      .attr("y", y(box.q3))
      .attr("height", Math.max(y(box.q1) - y(box.q3), 1));
  level(box.median, "median", 1);
  group.append("path")
      .attr("class", "mean")
      .attr("d", "M0,-4.5L4.5,0L0,4.5L-4.5,0Z")
      .attr("transform", `translate(${middle} ${y(box.mean)})`);
  group.append("circle").attr("class", "largest").attr("r", 2.75).attr("cx", middle).attr("cy", y(box.max));
  group.append("text").attr("x", middle).attr("y", height - 6).attr("text-anchor", "middle").text(box.name);
}

function describe(figure) {
  const sample = {
    box: (svg) =>
        svg.append("rect").attr("class", "box").attr("x", 4).attr("y", 1).attr("width", 14).attr("height", 10),
    whisker: (svg) => svg.append("path").attr("class", "whisker").attr("d", "M11,1V11M7,1H15M7,11H15"),
    median: (svg) =>
        svg.append("line").attr("class", "median").attr("x1", 4).attr("x2", 18).attr("y1", 6).attr("y2", 6),
    mean: (svg) => svg.append("path").attr("class", "mean").attr("d", "M11,1.5L15.5,6L11,10.5L6.5,6Z"),
    largest: (svg) => svg.append("circle").attr("class", "largest").attr("r", 2.75).attr("cx", 11).attr("cy", 6),
  };
  legend(figure, [
    {name: "half of the sweeps", draw: sample.box}, {name: "98 %", draw: sample.whisker},
    {name: "median", draw: sample.median}, {name: "mean", draw: sample.mean}, {name: "largest", draw: sample.largest}
  ]);
}
