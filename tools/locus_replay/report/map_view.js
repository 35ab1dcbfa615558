// SPDX-License-Identifier: Apache-2.0
// 3D view of the map: every voxel as a tile on its surface, coloured by height, viewed from the robot's side.
import {quantile} from "d3-array";
import {interpolateCividis} from "d3-scale-chromatic";
import {select} from "d3-selection";
import * as THREE from "three";
import {OrbitControls} from "three/examples/jsm/controls/OrbitControls.js";
import {Line2} from "three/examples/jsm/lines/Line2.js";
import {LineGeometry} from "three/examples/jsm/lines/LineGeometry.js";
import {LineMaterial} from "three/examples/jsm/lines/LineMaterial.js";

import {nearest, onCursor} from "./cursor.js";
import {colour, legend, lineSample, note} from "./drawing.js";
import {fixed} from "./format.js";
import {map, run} from "./run.js";

const kFieldOfView_deg = 40;
const kOverlap = 1.12;  // tiles are centred on the mean of a voxel's points, so some would leave gaps
let view = null;

/** Creates the view once; later calls only adapt it to the width and the colours of the page. */
export function mapView(figure) {
  if (view === null) view = makeView(figure);
  if (view) view.refresh();
}

function makeView(figure) {
  if (map.count === 0) {
    note(figure, "The map is empty: no sweep showed a surface.");
    return false;
  }
  if (!document.createElement("canvas").getContext("webgl")) {
    note(
        figure,
        "This browser offers no WebGL, which the map in space needs. Its walls are drawn in the path from above; " +
            "map.pcd beside this report opens in any viewer of point clouds.");
    return false;
  }
  // A preserved buffer makes "save image" work, and lets a test inspect the picture.
  return new View(figure, new THREE.WebGLRenderer({antialias: true, alpha: true, preserveDrawingBuffer: true}));
}

class View {
  constructor(figure, renderer) {
    this.box = figure.select(".drawing").node();
    this.renderer = renderer;
    this.heights = heightRange();
    this.scene = new THREE.Scene();
    this.tiles = makeTiles(this.heights);
    this.estimate = makePath(run.path, {width: 3, order: 2});
    this.scene.add(this.tiles, this.estimate);
    if (run.truth) this.scene.add(this.truth = makePath(run.truth, {width: 9, order: 1}));
    this.here =
        new THREE.Mesh(new THREE.SphereBufferGeometry(1, 20, 12), new THREE.MeshBasicMaterial({depthTest: false}));
    this.scene.add(this.here);
    this.here.renderOrder = 3;
    this.bounds = bounds();
    const size_m = this.bounds.getSize(new THREE.Vector3());
    this.oblique = obliqueView(size_m);

    this.box.append(renderer.domElement);
    select(renderer.domElement)
        .attr("role", "img")
        .attr("tabindex", 0)
        .attr(
            "aria-label", `Map of ${map.count} surfaces and the path through it; drag to turn, scroll to come nearer`);
    this.camera = new THREE.PerspectiveCamera(kFieldOfView_deg, 1, size_m.length() / 1000, size_m.length() * 20);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, renderer.domElement);
    this.controls.enableKeys = false;
    this.controls.addEventListener("change", () => this.render());
    this.addButtons(figure);
    this.resize();
    this.look(this.oblique);
    onCursor("map", (t) => this.pointAt(t));
    describe(figure, this.heights);
  }

  addButtons(figure) {
    const views = [["Oblique", this.oblique], ["Above", [0, -1e-3, 1]], ["Side", [0, -1, 0.08]]];
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

  /** Shows the whole map from that direction, as large as fits into the picture. */
  look(direction) {
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

  pointAt(t) {
    this.here.visible = t !== null;
    if (t !== null) {
      const i = nearest(run.path.t, t);
      this.here.position.set(run.path.x[i], run.path.y[i], run.path.z[i]);
      this.here.scale.setScalar(this.camera.position.distanceTo(this.here.position) / 90);
    }
    this.render();
  }

  resize() {
    const width = this.box.clientWidth, height = this.box.clientHeight;
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio || 1, 2));
    this.renderer.setSize(width, height);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    for (const path of [this.estimate, this.truth].filter(Boolean)) path.material.resolution.set(width, height);
  }

  /** Updates after a change of the page's size or colours. */
  refresh() {
    this.resize();
    this.tiles.material.uniforms.floor_tint.value.set(colour("wall"));
    this.estimate.material.color.set(colour("estimate"));
    this.here.material.color.set(colour("ink"));
    if (this.truth) this.truth.material.color.set(colour("truth"));
    this.render();
  }

  render() {
    this.renderer.render(this.scene, this.camera);
  }
}

/** Bounds of the heights, without the few far above or below. */
function heightRange() {
  const heights = Float32Array.from({length: map.count}, (_, i) => map.centres[3 * i + 2]).sort();
  const low = quantile(heights, 0.02), high = quantile(heights, 0.98);
  return {low, high: Math.max(high, low + 0.5)};
}

/** Bounds of the path and of the map, without outliers. */
function bounds() {
  const box = new THREE.Box3();
  for (const axis of [0, 1, 2]) {
    const along = Float32Array.from({length: map.count}, (_, i) => map.centres[3 * i + axis]).sort();
    box.min.setComponent(axis, quantile(along, 0.03));
    box.max.setComponent(axis, quantile(along, 0.97));
  }
  for (let i = 0; i < run.path.t.length; ++i)
    box.expandByPoint(new THREE.Vector3(run.path.x[i], run.path.y[i], run.path.z[i]));
  return box;
}

/** Views a long side from above, the one from which more tiles show their faces. */
function obliqueView({x, y}) {
  const along = x >= y ? [0.35, 0.8] : [0.8, 0.35];
  const directions = [[1, 1], [1, -1], [-1, 1], [-1, -1]].map(([a, b]) => [a * along[0], b * along[1], 0.75]);
  const faces = directions.map((direction) => {
    let facing = 0;
    for (let i = 0; i < 3 * map.count; i += 3)
      facing +=
          map.normals[i] * direction[0] + map.normals[i + 1] * direction[1] + map.normals[i + 2] * direction[2] > 0;
    return facing;
  });
  return directions[faces.indexOf(Math.max(...faces))];
}

const corners = ({min, max}) => [min.x, max.x].flatMap(
    (x) => [min.y, max.y].flatMap((y) => [min.z, max.z].map((z) => new THREE.Vector3(x, y, z))));

const kTileShader = {
  vertex: `
    precision highp float;
    uniform mat4 modelViewMatrix, projectionMatrix;
    uniform vec3 cameraPosition;
    uniform float side, low, high;
    uniform vec3 floor_tint;
    uniform sampler2D ramp;
    attribute vec3 position, centre, facing; // position: within the square
    varying vec3 tint;
    void main() {
      vec3 level = normalize(cross(abs(facing.z) < 0.9 ? vec3(0, 0, 1) : vec3(1, 0, 0), facing));
      vec3 upright = cross(facing, level);
      vec3 corner = centre + side * (position.x * level + position.y * upright);
      float light = 0.6 + 0.4 * abs(dot(facing, normalize(cameraPosition - centre)));
      vec3 by_height = texture2D(ramp, vec2(clamp((centre.z - low) / (high - low), 0.005, 0.995), 0.5)).rgb;
      tint = mix(light * by_height, floor_tint, 0.5 * smoothstep(0.6, 0.9, facing.z)); // darkens floors
      gl_Position = projectionMatrix * modelViewMatrix * vec4(corner, 1.0);
    }`,
  fragment: `
    precision mediump float;
    varying vec3 tint;
    void main() {
      if (!gl_FrontFacing && mod(gl_FragCoord.x, 4.0) + mod(gl_FragCoord.y, 4.0) > 1.5) discard;
      gl_FragColor = vec4(tint, 1.0);
    }`,
};

/** Draws one square in many instances. Back faces are translucent, so that rooms can be viewed from outside. */
function makeTiles({low, high}) {
  const geometry = new THREE.InstancedBufferGeometry();
  const corners = [-0.5, -0.5, 0, 0.5, -0.5, 0, 0.5, 0.5, 0, -0.5, 0.5, 0];
  geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(corners), 3));
  geometry.setIndex([0, 1, 2, 0, 2, 3]);
  geometry.setAttribute("centre", new THREE.InstancedBufferAttribute(map.centres, 3));
  geometry.setAttribute("facing", new THREE.InstancedBufferAttribute(map.normals, 3));
  const material = new THREE.RawShaderMaterial({
    vertexShader: kTileShader.vertex,
    fragmentShader: kTileShader.fragment,
    side: THREE.DoubleSide,
    uniforms: {
      side: {value: kOverlap * map.tile_m},
      floor_tint: {value: new THREE.Color()},
      low: {value: low},
      high: {value: high},
      ramp: {value: rampTexture()}
    },
  });
  const tiles = new THREE.Mesh(geometry, material);
  tiles.frustumCulled = false;  // bounds of the single square do not apply
  return tiles;
}

const rampAt = (share) => interpolateCividis(0.2 + 0.8 * share);

function rampTexture() {
  const kSteps = 128;
  const bytes = new Uint8Array(3 * kSteps);
  for (let i = 0; i < kSteps; ++i)
    new THREE.Color(rampAt(i / (kSteps - 1))).toArray().forEach((part, k) => bytes[3 * i + k] = 255 * part);
  const texture = new THREE.DataTexture(bytes, kSteps, 1, THREE.RGBFormat);
  texture.needsUpdate = true;
  texture.magFilter = texture.minFilter = THREE.LinearFilter;
  return texture;
}

function makePath(path, {width, order}) {
  const geometry = new LineGeometry();
  geometry.setPositions(path.t.flatMap((_, i) => [path.x[i], path.y[i], path.z[i]]));
  const material = new LineMaterial({linewidth: width, depthTest: false});
  const line = new Line2(geometry, material);
  line.renderOrder = order;
  return line;
}

function describe(figure, {low, high}) {
  const entries = [{name: "estimate", draw: lineSample("estimate")}];
  if (run.truth) entries.push({name: "truth", draw: lineSample("truth")});
  legend(figure, [...entries, {name: `height ${fixed(low, 1)} to ${fixed(high, 1)} m`, draw: rampSample}]);
}

function rampSample(svg) {
  for (let i = 0; i < 11; ++i)
    svg.append("rect").attr("x", 2 * i).attr("width", 2.2).attr("y", 1).attr("height", 10).attr("fill", rampAt(i / 10));
}
