// SPDX-License-Identifier: Apache-2.0
// Fig. 3: contribution of each part of LOCUS.
import {max, min} from "d3-array";
import {scaleLinear} from "d3-scale";
import {line} from "d3-shape";

import {bottomAxis, canvasOf, leftAxis, legend, lineSample} from "../../locus_replay/report/drawing.js";
import {clock, figure as written, timeTicks} from "../../locus_replay/report/format.js";
import {metreScale} from "./metres.js";
import {find} from "./results.js";
import {metres, missing, table} from "./table.js";

/** The paper's names, with the corresponding run. */
const kVariants = [
  {name: "baseline", run: "paper_fga", means: "all of the paper's Section II"},
  {name: "imu_int", run: "imu_int", means: "no wheel odometry, only the IMU"},
  {name: "no_int", run: "no_int", means: "neither wheel odometry nor IMU"},
  {name: "loam_feat", run: "loam_feat", means: "LOAM's edge and plane points instead of the filters"},
  {name: "fga_off", run: "paper", means: "no flat ground"},
  {name: "rdf_off", run: "rdf_off", means: "no random filter"},
  {name: "vgf_off", run: "vgf_off", means: "no voxel filter"},
  {name: "mdc_off", run: "mdc_off", means: "no motion correction"},
].map((variant, i) => ({...variant, result: find("alpha", variant.run), className: `variant-${i}`}));

const kMargin = {top: 8, right: 84, bottom: 26, left: 52};

export function ablation(figure, width) {
  const drawn = kVariants.filter(({result}) => result?.position_error);
  const height = Math.max(0.4 * width, 260);
  const svg = canvasOf(figure, width, height, "Position error over time, one line for each configuration");
  const errors_m = drawn.flatMap(({result}) => result.position_error.error_m);
  const span_s = max(drawn, ({result}) => result.position_error.t_s.at(-1));
  const x = scaleLinear([kMargin.left, width - kMargin.right]).domain([0, span_s]);
  const y = metreScale(min(errors_m), max(errors_m), [height - kMargin.bottom, kMargin.top]);
  bottomAxis(svg, x, {y: height - kMargin.bottom, height: height - kMargin.bottom - kMargin.top,
                      ticks: timeTicks(0, span_s, width / 90), format: (s) => clock(s)});
  leftAxis(svg, y, {x: kMargin.left, width: width - kMargin.left - kMargin.right, count: 4});
  for (const {result, className} of drawn) {
    const {t_s, error_m} = result.position_error;
    svg.append("path").attr("class", `variant ${className}`)
        .attr("d", line().x((_, i) => x(t_s[i])).y(y)(error_m));
  }
  nameLines(svg, drawn.map(({name, result}) => ({name, at: y(result.position_error.error_m.at(-1))})), width);
  legend(figure, drawn.map(({name, className}) => ({name, draw: lineSample(`variant ${className}`)})));
}

/** Labels at the ends of the lines, moved apart where they would overlap. */
function nameLines(svg, names, width) {
  names.sort((a, b) => a.at - b.at);
  names.forEach((name, i) => { if (i > 0) name.at = Math.max(name.at, names[i - 1].at + 13); });
  svg.append("g").selectAll("text").data(names).join("text").attr("x", width - kMargin.right + 6)
      .attr("y", ({at}) => at + 4).text(({name}) => name);
}

export function ablationTable(section) {
  const baseline_ms = kVariants[0].result?.summary.process_cpu_ms.p50;
  const rows = kVariants.map(({name, means, result}) => {
    const what = {text: means, className: "words"};
    if (!result?.summary.ape_m) return {cells: [name, missing, "", "", "", "", what]};
    const {ape_m: ape, process_cpu_ms: cpu, points} = result.summary;
    const share = baseline_ms > 0 ? `${written(cpu.p50 / baseline_ms)} ×` : "–";
    return {cells: [name, metres(ape.mean), metres(ape.max), written(points.filtered_mean), written(cpu.p50), share,
                    what]};
  });
  table(section.select(".drawing").html(""),
        ["", "mean APE, m", "max", "points", "CPU ms per sweep", "relative to baseline", ""], [{rows}]);
}
