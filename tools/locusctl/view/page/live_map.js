// SPDX-License-Identifier: Apache-2.0
// 3D view of the growing map, the newest sweep, the path, the robot and the ellipsoid of its position. It shows all of
// the map until the user turns it; a button of a direction shows all of it again.
import {select} from "d3-selection";
import * as THREE from "three";

import {colour, legend, lineSample, note} from "../../../locus_replay/report/drawing.js";
import {fixed} from "../../../locus_replay/report/format.js";
import {hasWebGL, lineThrough, SpaceView} from "../../../locus_replay/report/space_view.js";
import {boundsOf, heightRange, makeTiles, rampSample} from "../../../locus_replay/report/tiles.js";

import {deviations} from "./covariance.js";

const kSampledTiles = 5000;  // suffice for bounds and heights
const kFitPeriod_ms = 1000;

/** Returns the view, or null without WebGL. */
export function liveMap(figure, live) {
  if (hasWebGL()) return new LiveMap(figure, live);
  note(figure, "This browser has no WebGL, which the 3D map needs. All other figures are shown.");
  return null;
}

class LiveMap extends SpaceView {
  constructor(figure, live) {
    super(figure, {label: "Map, newest sweep and path of the robot", oblique: [-0.5, -0.8, 0.9]});
    this.figure = figure;
    this.live = live;
    this.fits = true;
    this.fitted_at = 0;
    this.controls.addEventListener("start", () => this.fits = false);
    select(this.box).selectAll("button").on("click.fit", () => this.fits = true);
    this.tiles = makeTiles(live.tiles, {low: 0, high: 1});
    this.sweep = pointsOf([], 2);
    this.path = null;
    this.robot = makeRobot();
    this.ellipsoid = new THREE.Mesh(
        new THREE.SphereBufferGeometry(1, 32, 16),
        new THREE.MeshBasicMaterial({transparent: true, opacity: 0.35, depthTest: false}));
    this.ellipsoid.renderOrder = 3;
    this.scene.add(this.tiles, this.sweep, this.ellipsoid, this.robot);
    this.refresh();
  }

  /** Draws what has changed, see Live.add(). */
  update(changed) {
    if (changed.is_new) {
      this.bounds = new THREE.Box3();
      this.fitted_at = 0;
    }
    if (changed.tiles) this.updateTiles(changed.first_tile);
    if (changed.path) this.updatePath();
    if (changed.sweep) this.updateSweep();
    if (changed.tiles || changed.sweep) this.fit();
    this.render();
  }

  updateTiles(first) {
    const {count, tile_m} = this.live.tiles, geometry = this.tiles.geometry;
    for (const name of ["centre", "facing"]) {
      const attribute = geometry.getAttribute(name);
      attribute.updateRange = {offset: 3 * first, count: 3 * (count - first)};
      attribute.needsUpdate = true;
    }
    geometry.maxInstancedCount = count;
    this.tiles.setSide(tile_m);
  }

  updatePath() {
    if (this.live.path.length < 6) {
      if (this.path) this.path.visible = false;
      return;
    }
    if (this.path) {
      this.path.geometry.dispose();
      this.path.geometry = lineThrough(this.live.path);
    } else {
      this.path = this.addPath(this.live.path, {width: 3, order: 2});
      this.refresh();
    }
    this.path.visible = true;
  }

  updateSweep() {
    const {pose, sweep, status} = this.live;
    this.sweep.geometry.dispose();
    this.sweep.geometry = new THREE.BufferGeometry();
    this.sweep.geometry.setAttribute("position", new THREE.BufferAttribute(sweep, 3));
    this.robot.position.set(...pose.xyz_m);
    this.robot.quaternion.set(...pose.quaternion_xyzw);
    const ellipsoid = deviations(status?.covariance);
    this.ellipsoid.visible = ellipsoid !== null;
    if (!ellipsoid) return;
    const axes = ellipsoid.axes.map((axis, i) => new THREE.Vector3(...axis).multiplyScalar(3 * ellipsoid.sd_m[i]));
    this.ellipsoid.matrixAutoUpdate = false;
    this.ellipsoid.matrix.makeBasis(...axes).setPosition(...pose.xyz_m);
  }

  /** Adapts the heights of the colours, and the camera unless the user has turned it. */
  fit() {
    const now = performance.now(), {count, centres} = this.live.tiles;
    if (count === 0 || now - this.fitted_at < kFitPeriod_ms) return;
    this.fitted_at = now;
    const step = Math.ceil(count / kSampledTiles), sampled = Math.floor(count / step);
    const sample = {
      count: sampled,
      centres: Float32Array.from({length: 3 * sampled}, (_, i) => centres[3 * step * Math.floor(i / 3) + i % 3])
    };
    const heights = heightRange(sample);
    this.tiles.setHeights(heights);
    this.describe(heights);
    const box = boundsOf(sample).expandByPoint(this.robot.position);
    if (!this.fits || this.bounds.containsBox(box)) return;
    this.bounds = box.expandByScalar(0.02 * box.getSize(new THREE.Vector3()).length());
    this.look();
  }

  render() {
    const distance_m = this.camera.position.distanceTo(this.robot.position);
    this.robot.scale.setScalar(Math.max(distance_m / 40, 0.1));
    super.render();
  }

  /** Updates after a change of the page's size or colours. */
  refresh() {
    this.resize();
    if (this.fits && !this.bounds.isEmpty()) this.look();
    this.tiles.material.uniforms.floor_tint.value.set(colour("wall"));
    this.sweep.material.color.set(colour("sweep"));
    this.robot.material.color.set(colour("ink"));
    this.ellipsoid.material.color.set(colour("estimate"));
    if (this.path) this.path.material.color.set(colour("estimate"));
    this.render();
  }

  describe({low, high}) {
    legend(this.figure, [
      {name: "newest sweep", draw: (svg) => svg.append("circle").attr("class", "sweep").attr("r", 3).attr("cx", 11).attr("cy", 6)},
      {name: "path", draw: lineSample("estimate")},
      {name: `height ${fixed(low, 1)} to ${fixed(high, 1)} m`, draw: rampSample},
    ]);
  }
}

function pointsOf(positions, size) {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(positions), 3));
  const points = new THREE.Points(geometry, new THREE.PointsMaterial({size, sizeAttenuation: false}));
  points.frustumCulled = false;
  return points;
}

/** Builds a flat arrow along x of the base. */
function makeRobot() {
  const geometry = new THREE.BufferGeometry();
  const corners = [1.2, 0, 0, -0.6, 0.7, 0, -0.2, 0, 0, -0.6, -0.7, 0];
  geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(corners), 3));
  geometry.setIndex([0, 1, 2, 0, 2, 3]);
  const robot = new THREE.Mesh(geometry, new THREE.MeshBasicMaterial({side: THREE.DoubleSide, depthTest: false}));
  robot.renderOrder = 4;
  robot.frustumCulled = false;
  return robot;
}
