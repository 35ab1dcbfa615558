// SPDX-License-Identifier: Apache-2.0
// 3D view that can be turned with the mouse, and is set to a direction by buttons.
import {select} from "d3-selection";
import * as THREE from "three";
import {OrbitControls} from "three/examples/jsm/controls/OrbitControls.js";
import {Line2} from "three/examples/jsm/lines/Line2.js";
import {LineGeometry} from "three/examples/jsm/lines/LineGeometry.js";
import {LineMaterial} from "three/examples/jsm/lines/LineMaterial.js";

const kFieldOfView_deg = 40;

export const hasWebGL = () => document.createElement("canvas").getContext("webgl") !== null;

/** Base of the views. Precondition: hasWebGL(). Set `bounds`, a Box3, before look(). */
export class SpaceView {
  constructor(figure, {label, oblique}) {
    this.box = figure.select(".drawing").node();
    // A preserved buffer makes "save image" work, and lets a test inspect the picture.
    this.renderer = new THREE.WebGLRenderer({antialias: true, alpha: true, preserveDrawingBuffer: true});
    this.scene = new THREE.Scene();
    this.bounds = new THREE.Box3();
    this.paths = [];
    this.direction = oblique;
    this.box.append(this.renderer.domElement);
    select(this.renderer.domElement)
        .attr("role", "img")
        .attr("tabindex", 0)
        .attr("aria-label", `${label}; drag to turn, scroll to come nearer`);
    this.camera = new THREE.PerspectiveCamera(kFieldOfView_deg, 1);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, this.renderer.domElement);
    this.controls.enableKeys = false;
    this.controls.addEventListener("change", () => this.render());
    this.addButtons(figure, oblique);
  }

  addButtons(figure, oblique) {
    const views = [["Oblique", oblique], ["Above", [0, -1e-3, 1]], ["Side", [0, -1, 0.08]]];
    figure.select(".drawing")
        .append("div")
        .attr("class", "views")
        .selectAll("button")
        .data(views)
        .join("button")
        .attr("type", "button")
        .text(([name]) => name)
        .on("click", ([, direction]) => {
          this.look(direction);
          this.render();
        });
  }

  /** Shows everything within the bounds from that direction, as large as fits into the picture. */
  look(direction = this.direction) {
    this.direction = direction;
    const size_m = this.bounds.getSize(new THREE.Vector3()).length();
    this.camera.near = size_m / 1000;
    this.camera.far = size_m * 20;
    this.camera.updateProjectionMatrix();
    const centre = this.bounds.getCenter(new THREE.Vector3()), back = new THREE.Vector3(...direction).normalize();
    this.controls.target.copy(centre);
    this.camera.position.copy(centre).add(back);
    this.camera.lookAt(centre);
    const half_height = Math.tan(THREE.Math.degToRad(kFieldOfView_deg / 2)),
          half_width = half_height * this.camera.aspect;
    const away = corners(this.bounds).map((corner) => {
      const seen = corner.sub(centre).applyQuaternion(this.camera.quaternion.clone().inverse());
      return Math.max(Math.abs(seen.x) / half_width, Math.abs(seen.y) / half_height) + seen.z;
    });
    this.camera.position.copy(centre).addScaledVector(back, 1.04 * Math.max(...away));
    this.controls.update();
  }

  /** Adds a line through positions [x, y, z, x, ...], in pixels of width. */
  addPath(positions, {width, order}) {
    const material = new LineMaterial({linewidth: width, depthTest: false});
    const line = new Line2(lineThrough(positions), material);
    line.renderOrder = order;
    line.frustumCulled = false;
    this.paths.push(line);
    this.scene.add(line);
    return line;
  }

  resize() {
    const width = this.box.clientWidth, height = this.box.clientHeight;
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio || 1, 2));
    this.renderer.setSize(width, height);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    for (const path of this.paths) path.material.resolution.set(width, height);
  }

  render() {
    this.renderer.render(this.scene, this.camera);
  }
}

export function lineThrough(positions) {
  const geometry = new LineGeometry();
  geometry.setPositions(positions);
  return geometry;
}

const corners = ({min, max}) => [min.x, max.x].flatMap(
    (x) => [min.y, max.y].flatMap((y) => [min.z, max.z].map((z) => new THREE.Vector3(x, y, z))));
