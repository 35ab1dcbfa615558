// SPDX-License-Identifier: Apache-2.0
// Surfaces of a map as tiles coloured by height.
import {quantile} from "d3-array";
import {interpolateCividis} from "d3-scale-chromatic";
import * as THREE from "three";

const kOverlap = 1.12;  // tiles are centred on the mean of a voxel's points, so some would leave gaps

/** Returns the coordinates of the centres along an axis, in ascending order. */
const along = ({count, centres}, axis) => Float32Array.from({length: count}, (_, i) => centres[3 * i + axis]).sort();

/** Returns the bounds of the heights, without the few far above or below. */
export function heightRange(map) {
  const heights = along(map, 2);
  const low = quantile(heights, 0.02), high = quantile(heights, 0.98);
  return {low, high: Math.max(high, low + 0.5)};
}

/** Returns the bounds of the map without outliers. */
export function boundsOf(map) {
  const box = new THREE.Box3();
  for (const axis of [0, 1, 2]) {
    const coordinates = along(map, axis);
    box.min.setComponent(axis, quantile(coordinates, 0.03));
    box.max.setComponent(axis, quantile(coordinates, 0.97));
  }
  return box;
}

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
class Tiles extends THREE.Mesh {
  setSide(tile_m) {
    this.material.uniforms.side.value = kOverlap * tile_m;
  }

  /** Sets the heights of the first and the last colour. */
  setHeights({low, high}) {
    this.material.uniforms.low.value = low;
    this.material.uniforms.high.value = high;
  }
}

export function makeTiles({tile_m, centres, normals}, heights) {
  const geometry = new THREE.InstancedBufferGeometry();
  const corners = [-0.5, -0.5, 0, 0.5, -0.5, 0, 0.5, 0.5, 0, -0.5, 0.5, 0];
  geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(corners), 3));
  geometry.setIndex([0, 1, 2, 0, 2, 3]);
  geometry.setAttribute("centre", new THREE.InstancedBufferAttribute(centres, 3));
  geometry.setAttribute("facing", new THREE.InstancedBufferAttribute(normals, 3));
  const material = new THREE.RawShaderMaterial({
    vertexShader: kTileShader.vertex,
    fragmentShader: kTileShader.fragment,
    side: THREE.DoubleSide,
    uniforms: {
      side: {value: 0},
      floor_tint: {value: new THREE.Color()},
      low: {value: 0},
      high: {value: 1},
      ramp: {value: rampTexture()}
    },
  });
  const tiles = new Tiles(geometry, material);
  tiles.frustumCulled = false;  // bounds of the single square do not apply
  tiles.setSide(tile_m);
  tiles.setHeights(heights);
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

/** Draws a sample of the colours into an SVG of 22 by 12, for a legend. */
export function rampSample(svg) {
  for (let i = 0; i < 11; ++i)
    svg.append("rect").attr("x", 2 * i).attr("width", 2.2).attr("y", 1).attr("height", 10).attr("fill", rampAt(i / 10));
}
