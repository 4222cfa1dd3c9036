/** How objects are drawn. */
import assert from "node:assert/strict";
import { test } from "node:test";
import * as THREE from "three";
import type { Column } from "../src/engine/protocol";
import { Instances } from "../src/view/instances";
import { along } from "../src/view/scenery";

test("strands are not joined to each other, and a curve is one piece", () => {
  const curve = Uint32Array.from([0, 1, 2, 3, 4, 5]);
  assert.deepEqual([...along(curve)], [0, 1, 1, 2, 2, 3, 3, 4, 4, 5]);
  assert.deepEqual([...along(curve, 3)], [0, 1, 1, 2, 3, 4, 4, 5]);
  assert.deepEqual([...along(Uint32Array.from([]), 3)], []);
});

const column = (width: number, rows: number[][], Kind: typeof Float32Array | typeof Uint32Array = Float32Array): Column => ({
  data: Kind.from(rows.flat()),
  width,
  points: [],
  unit: "1",
});

/** A plate of 4 m x 2 m, of 2 bodies. */
const PLATE = {
  vertices: column(3, [
    [-2, -1, 0],
    [2, -1, 0],
    [2, 1, 0],
    [-2, 1, 0],
  ]),
  triangles: column(
    3,
    [
      [0, 1, 2],
      [0, 2, 3],
    ],
    Uint32Array,
  ),
  mass: column(1, [[1], [1]]),
};

test("bodies are seen and met where they are, as they are turned", () => {
  const layer = new Instances(PLATE, [0.1, 0.2, 0.3]);
  const down = new THREE.Vector3(0, 0, -1);
  const at = (x: number, y: number) => layer.hit(new THREE.Raycaster(new THREE.Vector3(x, y, 9), down));
  const around = () => {
    const box = new THREE.Box3();
    layer.expand(box);
    return [...box.min.toArray(), ...box.max.toArray()].map((v) => Math.round(1e6 * v) / 1e6);
  };
  assert.equal(layer.object.count, 0);
  const half = Math.SQRT1_2;
  const position = column(3, [
    [0, 0, 0],
    [10, 0, 1],
  ]);
  // The second by a quarter about z.
  const turn = column(4, [
    [0, 0, 0, 1],
    [0, 0, half, half],
  ]);
  layer.set({ position, turn });
  assert.deepEqual([at(1.9, 0), at(0, 1.9), at(11.9, 0), at(10, 1.9)], [0, undefined, undefined, 1]);
  assert.deepEqual(around(), [-2, -2, 0, 11, 2, 1]);
  // Where they are met goes along, and what is no number makes no room.
  position.data[0] = 20;
  layer.set({ position, turn });
  assert.deepEqual([at(1.9, 0), at(21.9, 0)], [undefined, 0]);
  position.data[0] = NaN;
  layer.set({ position, turn });
  assert.deepEqual(around(), [9, -2, 1, 11, 2, 1]);
  layer.dispose();
});

test("bodies have the colour of their object, or each its own", () => {
  const layer = new Instances(PLATE, [0.1, 0.2, 0.3]);
  const shown = (i: number) => {
    const color = new THREE.Color();
    layer.object.getColorAt(i, color);
    return color
      .multiply(layer.object.material.color)
      .toArray()
      .map((v) => Math.round(1e6 * v) / 1e6);
  };
  assert.deepEqual([shown(0), shown(1)], Array(2).fill([0.1, 0.2, 0.3]));
  layer.paint(Float32Array.from([1, 0, 0, 0, 1, 0]));
  assert.deepEqual(
    [shown(0), shown(1)],
    [
      [1, 0, 0],
      [0, 1, 0],
    ],
  );
  layer.paint(null);
  assert.deepEqual(shown(1), [0.1, 0.2, 0.3]);
});
