/** Scenery of a scene, as drawables. */
import * as THREE from "three";
import { MATTER, SHOWN, SOLID } from "../engine/looks";
import type { Column, Numbers, SceneInfo, Vector } from "../engine/protocol";
import { table } from "./colors";
import { type Grid, type Pieces, type Rgb, scalars } from "./layers";

function made(info: SceneInfo, of: string): SceneInfo["objects"] {
  const names = new Set(info.looks.objects.filter((look) => MATTER[look.form] === of).map((look) => look.object));
  return info.objects.filter((o) => names.has(o.name));
}

/** Objects that lie on grids, and those that are made of masses. */
export const gridsOf = (info: SceneInfo): SceneInfo["objects"] => made(info, "cells");
export const massesOf = (info: SceneInfo): SceneInfo["objects"] => made(info, "masses");

/** The column of a grid that is shown where `chosen` is asked for; a difference before all. */
export function shownOf(columns: Record<string, Column>, chosen: string | null): string | undefined {
  const has = (name: string) => name in columns || (name === "speed" && "velocity" in columns);
  if (has("difference")) return "difference";
  if (chosen && has(chosen)) return chosen;
  const varied = SHOWN.find((name) => {
    if (!has(name)) return false;
    const values = scalars(columns[name] ?? columns.velocity);
    return values.some((v) => v !== values[0]);
  });
  return varied ?? SHOWN.find(has);
}

/** Arrows along a velocity, so many that they do not meet; the fastest are as long as the way between two. */
export function arrows(pieces: Pieces, grid: Grid, velocity: Column, fastest: number, shade: number): void {
  const [a, b] = [0, 1, 2].filter((axis) => axis !== grid.flat);
  const n = grid.cells[a];
  const m = grid.cells[b];
  const every = Math.max(1, Math.round(Math.max(n, m) / 40));
  const v = velocity.data;
  const scale = fastest > 0 ? (1.6 * every * grid.spacing) / fastest : 0;
  const across = grid.origin[grid.flat] + 0.5 * grid.spacing;
  const { start, end, tint } = pieces.begin(3 * Math.ceil(n / every) * Math.ceil(m / every));
  let k = 0;
  const put = (p: number[], q: number[]) => {
    for (let d = 0; d < 3; d++) {
      start[3 * k + d] = p[d];
      end[3 * k + d] = q[d];
    }
    tint.set([shade, shade, shade, 0.85], 4 * k);
    k++;
  };
  const at = (u: number, w: number) => {
    const p = [0, 0, 0];
    p[a] = u;
    p[b] = w;
    p[grid.flat] = across;
    return p;
  };
  for (let j = Math.floor(every / 2); j < m; j += every) {
    for (let i = Math.floor(every / 2); i < n; i += every) {
      const c = i + n * j;
      const vx = v[2 * c] * scale;
      const vy = v[2 * c + 1] * scale;
      const length = Math.hypot(vx, vy);
      if (!(length > 0.12 * every * grid.spacing)) continue;
      const x = grid.origin[a] + (i + 0.5) * grid.spacing;
      const y = grid.origin[b] + (j + 0.5) * grid.spacing;
      const tip = at(x + 0.5 * vx, y + 0.5 * vy);
      put(at(x - 0.5 * vx, y - 0.5 * vy), tip);
      for (const s of [1, -1]) put(tip, at(x + 0.5 * vx - 0.28 * (vx - 0.6 * s * vy), y + 0.5 * vy - 0.28 * (vy + 0.6 * s * vx)));
    }
  }
  pieces.done(k);
}

/** Pairs of masses along a curve, or along many of so many masses each. */
export function along(curve: Numbers, each = Infinity): Uint32Array {
  const pairs: number[] = [];
  for (let i = 0; i + 1 < curve.length; i++) if ((i + 1) % each) pairs.push(curve[i], curve[i + 1]);
  return Uint32Array.from(pairs);
}

export function carry(columns: Record<string, Column>, point: THREE.Vector3, normal: THREE.Vector3): void {
  if (!columns.turn) return;
  const q = new THREE.Quaternion(...([...columns.turn.data] as [number, number, number, number]));
  point.applyQuaternion(q).add(new THREE.Vector3(...([...(columns.translation?.data ?? [0, 0, 0])] as Vector)));
  normal.applyQuaternion(q);
}

/** A disk of radius 1 that fades away towards its rim. */
export function ground(): THREE.Mesh {
  const material = new THREE.MeshStandardMaterial({ roughness: 1, transparent: true, side: THREE.FrontSide });
  material.onBeforeCompile = (shader) => {
    shader.vertexShader = shader.vertexShader
      .replace("#include <common>", "#include <common>\nvarying vec2 vAway;")
      .replace("#include <begin_vertex>", "#include <begin_vertex>\nvAway = position.xy;");
    shader.fragmentShader = shader.fragmentShader
      .replace("#include <common>", "#include <common>\nvarying vec2 vAway;")
      .replace(
        "#include <alphamap_fragment>",
        "#include <alphamap_fragment>\ndiffuseColor.a *= 1.0 - smoothstep(0.30, 1.0, length(vAway));",
      );
  };
  const disk = new THREE.Mesh(new THREE.CircleGeometry(1, 96), material);
  disk.receiveShadow = true;
  disk.renderOrder = -2;
  return disk;
}

/** A line around a grid in a plane. */
export function outline(line: Pieces, grid: Grid): void {
  const [a, b] = [0, 1, 2].filter((axis) => axis !== grid.flat);
  const corners = [
    [0, 0],
    [1, 0],
    [1, 1],
    [0, 1],
  ].flatMap(([u, v]) => {
    const p = grid.origin.map((o, axis) => o + 0.5 * grid.cells[axis] * grid.spacing);
    p[a] = grid.origin[a] + u * grid.cells[a] * grid.spacing;
    p[b] = grid.origin[b] + v * grid.cells[b] * grid.spacing;
    return p;
  });
  line.pairs(Float32Array.from(corners), Uint32Array.from([0, 1, 1, 2, 2, 3, 3, 0]), SOLID);
}

/** Pairs of vertices along sharp edges of a mesh; of a round one all. */
export function sharp(x: Numbers, triangles: Numbers): Uint32Array {
  const faces = new Map<string, THREE.Vector3[]>();
  const point = (i: number) => new THREE.Vector3(x[3 * i], x[3 * i + 1], x[3 * i + 2]);
  for (let t = 0; t < triangles.length; t += 3) {
    const [a, b, c] = [triangles[t], triangles[t + 1], triangles[t + 2]];
    const normal = point(b)
      .sub(point(a))
      .cross(point(c).sub(point(a)))
      .normalize();
    for (const [p, q] of [
      [a, b],
      [b, c],
      [c, a],
    ]) {
      const key = `${Math.min(p, q)} ${Math.max(p, q)}`;
      faces.set(key, [...(faces.get(key) ?? []), normal]);
    }
  }
  const pairs = [...faces].map(([key, n]) => ({ ends: key.split(" ").map(Number), sharp: n.length !== 2 || n[0].dot(n[1]) < 0.7 }));
  const some = pairs.filter((p) => p.sharp);
  return Uint32Array.from((some.length ? some : pairs).flatMap((p) => p.ends));
}

/** Rows of particles that are in two frames. */
export function* matched(before: Numbers | undefined, after: Numbers | undefined, n: number, m: number): Generator<[number, number]> {
  if (before && after) {
    const rows = new Map<number, number>();
    for (let i = 0; i < n; i++) rows.set(before[i], i);
    for (let j = 0; j < m; j++) {
      const i = rows.get(after[j]);
      if (i !== undefined) yield [i, j];
    }
  } else for (let i = 0; i < Math.min(n, m); i++) yield [i, i];
}

const PALETTES = new Map<string, Float32Array>();

/** A map of colours in linear light. */
export function palette(name: Parameters<typeof table>[0]): Float32Array {
  let known = PALETTES.get(name);
  if (!known) {
    const bytes = table(name);
    const c = new THREE.Color();
    known = new Float32Array(256 * 3);
    for (let i = 0; i < 256; i++)
      known.set(c.setRGB(bytes[4 * i] / 255, bytes[4 * i + 1] / 255, bytes[4 * i + 2] / 255, THREE.SRGBColorSpace).toArray(), 3 * i);
    PALETTES.set(name, known);
  }
  return known;
}

export function pick(map: Float32Array, share: number): Rgb {
  const i = 3 * Math.round(255 * Math.min(Math.max(share || 0, 0), 1));
  return [map[i], map[i + 1], map[i + 2]];
}
