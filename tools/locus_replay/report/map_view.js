// SPDX-License-Identifier: Apache-2.0
// 3D view of the map: every voxel as a tile on its surface, coloured by height, viewed from the robot's side.
import * as THREE from "three";

import {nearest, onCursor} from "./cursor.js";
import {colour, legend, lineSample, note} from "./drawing.js";
import {fixed} from "./format.js";
import {map, run} from "./run.js";
import {hasWebGL, SpaceView} from "./space_view.js";
import {boundsOf, heightRange, makeTiles, rampSample} from "./tiles.js";

let view = null;

/** Creates the view once; later calls only adapt it to the width and the colours of the page. */
export function mapView(figure) {
  if (view === null) view = makeView(figure);
  if (view) view.refresh();
}

function makeView(figure) {
  if (map.count === 0) {
    note(figure, "The map is empty: no sweep contained a surface.");
    return false;
  }
  if (!hasWebGL()) {
    note(
        figure,
        "This browser has no WebGL, which the 3D map needs. The path from above shows its walls; " +
            "map.pcd beside this report opens in any viewer of point clouds.");
    return false;
  }
  return new MapView(figure);
}

class MapView extends SpaceView {
  constructor(figure) {
    const box = bounds();
    super(figure, {
      label: `Map of ${map.count} surfaces and the path through it`,
      oblique: obliqueView(box.getSize(new THREE.Vector3()))
    });
    this.bounds = box;
    const heights = heightRange(map);
    this.tiles = makeTiles(map, heights);
    this.scene.add(this.tiles);
    this.estimate = this.addPath(positionsOf(run.path), {width: 3, order: 2});
    if (run.truth) this.truth = this.addPath(positionsOf(run.truth), {width: 9, order: 1});
    this.here =
        new THREE.Mesh(new THREE.SphereBufferGeometry(1, 20, 12), new THREE.MeshBasicMaterial({depthTest: false}));
    this.scene.add(this.here);
    this.here.renderOrder = 3;
    this.resize();
    this.look();
    onCursor("map", (t) => this.pointAt(t));
    describe(figure, heights);
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

  /** Updates after a change of the page's size or colours. */
  refresh() {
    this.resize();
    this.tiles.material.uniforms.floor_tint.value.set(colour("wall"));
    this.estimate.material.color.set(colour("estimate"));
    this.here.material.color.set(colour("ink"));
    if (this.truth) this.truth.material.color.set(colour("truth"));
    this.render();
  }
}

const positionsOf = (path) => path.t.flatMap((_, i) => [path.x[i], path.y[i], path.z[i]]);

/** Returns the bounds of the path and of the map. */
function bounds() {
  const box = boundsOf(map);
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

function describe(figure, {low, high}) {
  const entries = [{name: "estimate", draw: lineSample("estimate")}];
  if (run.truth) entries.push({name: "truth", draw: lineSample("truth")});
  legend(figure, [...entries, {name: `height ${fixed(low, 1)} to ${fixed(high, 1)} m`, draw: rampSample}]);
}
