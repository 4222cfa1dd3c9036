/** How objects are drawn. */
import assert from "node:assert/strict";
import { test } from "node:test";
import { along } from "../src/view/scenery";

test("strands are not joined to each other, and a curve is one piece", () => {
  const curve = Uint32Array.from([0, 1, 2, 3, 4, 5]);
  assert.deepEqual([...along(curve)], [0, 1, 1, 2, 2, 3, 3, 4, 4, 5]);
  assert.deepEqual([...along(curve, 3)], [0, 1, 1, 2, 3, 4, 4, 5]);
  assert.deepEqual([...along(Uint32Array.from([]), 3)], []);
});
