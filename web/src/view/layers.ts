/** Drawers, one for each kind of column: points, pieces (curves, links, ways), meshes, fields in a plane, fields in space. */
import * as THREE from "three";
import { toCreasedNormals } from "three/examples/jsm/utils/BufferGeometryUtils.js";
import type { Column, Numbers } from "../engine/protocol";
import { type MapName, mapOf, table } from "./colors";
import { SOLIDS } from "./depths";
import { BALLS, PIECES, PLANE, SPACE } from "./shaders";

export type Rgb = [number, number, number];

/** Size of the picture [pixels of the device], shared by all that has a width in pixels. */
export const PIXELS = { value: new THREE.Vector2(1, 1) };

export interface Layer {
  readonly object: THREE.Object3D;
  dispose(): void;
}

export function release(object: THREE.Object3D): void {
  object.traverse((o) => {
    const mesh = o as THREE.Mesh;
    mesh.geometry?.dispose();
    for (const material of [mesh.material ?? []].flat()) material.dispose();
  });
}

/** A little farther away than it is. */
export const BEHIND = { polygonOffset: true, polygonOffsetFactor: 2, polygonOffsetUnits: 8 };

/** Grows by half as much again, so that a growing swarm seldom makes new buffers. */
function room(attribute: THREE.BufferAttribute | undefined, count: number, width: number, instanced: boolean): THREE.BufferAttribute {
  if (attribute && attribute.count >= count) return attribute;
  const data = new Float32Array(Math.ceil(count * 1.5 + 8) * width);
  const made = instanced ? new THREE.InstancedBufferAttribute(data, width) : new THREE.BufferAttribute(data, width);
  made.setUsage(THREE.DynamicDrawUsage);
  return made;
}

/** Balls. */
export class Points implements Layer {
  readonly object: THREE.Points;
  private readonly geometry = new THREE.BufferGeometry();

  /** Lights in the dark, or, of a ghost, rings. */
  constructor(glow: boolean, thinnest = 1.5, ghost = false) {
    const material = new THREE.ShaderMaterial({
      vertexShader: BALLS.vertex,
      fragmentShader: BALLS.fragment,
      uniforms: { thinnest: { value: thinnest }, size: PIXELS, glow: { value: glow }, ghost: { value: ghost } },
      transparent: glow || ghost,
      depthWrite: !glow && !ghost,
      blending: glow ? THREE.AdditiveBlending : THREE.NormalBlending,
    });
    this.object = new THREE.Points(this.geometry, material);
    this.object.frustumCulled = false;
  }

  /** Radius and colour: one for all, or one for each. */
  set(position: Numbers, radius: number | Numbers, color: Rgb | Numbers): void {
    const n = position.length / 3;
    const g = this.geometry;
    const old = g.getAttribute("position") as THREE.BufferAttribute | undefined;
    const p = room(old, n, 3, false);
    if (p !== old) {
      g.dispose();
      g.setAttribute("position", p);
      g.setAttribute("tint", room(undefined, n, 3, false));
      g.setAttribute("radius", room(undefined, n, 1, false));
    }
    const tint = g.getAttribute("tint") as THREE.BufferAttribute;
    const r = g.getAttribute("radius") as THREE.BufferAttribute;
    p.array.set(position);
    if (typeof radius === "number") r.array.fill(radius, 0, n);
    else r.array.set(radius);
    if (color.length === 3 && n !== 1) for (let i = 0; i < n; i++) tint.array.set(color, 3 * i);
    else tint.array.set(color);
    p.needsUpdate = tint.needsUpdate = r.needsUpdate = true;
    g.setDrawRange(0, n);
  }

  dispose(): void {
    release(this.object);
  }
}

/** Straight pieces: links, ropes, ways behind particles, arrows. */
export class Pieces implements Layer {
  readonly object: THREE.Mesh;
  private readonly geometry = new THREE.InstancedBufferGeometry();
  private readonly material: THREE.ShaderMaterial;

  constructor(radius: number, { lit = true, glow = false, thinnest = 0.75, front = false } = {}) {
    this.geometry.setAttribute("position", new THREE.Float32BufferAttribute([-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0], 3));
    this.geometry.setIndex([0, 1, 2, 0, 2, 3]);
    this.geometry.instanceCount = 0;
    this.material = new THREE.ShaderMaterial({
      vertexShader: PIECES.vertex,
      fragmentShader: PIECES.fragment,
      uniforms: { radius: { value: radius }, thinnest: { value: thinnest }, size: PIXELS, lit: { value: lit ? 1 : 0 }, fade: { value: 1 } },
      transparent: !lit || glow,
      // Round edges of solid pieces by coverage: blended ones would hide what lies behind them.
      alphaToCoverage: lit && !glow,
      depthWrite: !glow && lit,
      depthTest: !front,
      blending: glow ? THREE.AdditiveBlending : THREE.NormalBlending,
      side: THREE.DoubleSide,
    });
    this.object = new THREE.Mesh(this.geometry, this.material);
    this.object.frustumCulled = false;
    if (front) this.object.renderOrder = 5;
  }

  /** Makes room for `count` pieces; fill the arrays (3, 3 and 4 numbers each) and call `done`. */
  begin(count: number): { start: Float32Array; end: Float32Array; tint: Float32Array } {
    const g = this.geometry;
    const old = g.getAttribute("start") as THREE.BufferAttribute | undefined;
    if (!old || old.count < count) {
      g.dispose();
      g.setAttribute("start", room(undefined, count, 3, true));
      g.setAttribute("end", room(undefined, count, 3, true));
      g.setAttribute("tint", room(undefined, count, 4, true));
    }
    const array = (name: string) => (g.getAttribute(name) as THREE.BufferAttribute).array as Float32Array;
    return { start: array("start"), end: array("end"), tint: array("tint") };
  }

  done(count: number): void {
    for (const name of ["start", "end", "tint"]) (this.geometry.getAttribute(name) as THREE.BufferAttribute).needsUpdate = true;
    this.geometry.instanceCount = count;
  }

  /** Pieces between points, by pairs of indices; those where `skip` is true are left out. */
  pairs(x: Numbers, pairs: Numbers, color: Rgb | ((piece: number) => Rgb), skip?: (piece: number) => boolean): void {
    const n = pairs.length / 2;
    const { start, end, tint } = this.begin(n);
    let k = 0;
    for (let i = 0; i < n; i++) {
      if (skip?.(i)) continue;
      const a = 3 * pairs[2 * i];
      const b = 3 * pairs[2 * i + 1];
      const c = typeof color === "function" ? color(i) : color;
      for (let d = 0; d < 3; d++) {
        start[3 * k + d] = x[a + d];
        end[3 * k + d] = x[b + d];
        tint[4 * k + d] = c[d];
      }
      tint[4 * k + 3] = 1;
      k++;
    }
    this.done(k);
  }

  /** Lets one see through it, and through to what lies in the same place. */
  veil(opacity: number): void {
    this.material.uniforms.fade.value = opacity;
    Object.assign(this.material, BEHIND);
  }

  dispose(): void {
    release(this.object);
  }
}

/** The surface of a liquid: other triangles in each frame, shiny, and seen through. */
export class Water implements Layer {
  readonly object: THREE.Mesh;
  private readonly material = new THREE.MeshPhysicalMaterial({
    roughness: 0.08,
    clearcoat: 1,
    transparent: true,
    opacity: 0.72,
    side: THREE.DoubleSide,
  });

  constructor(color: Rgb) {
    this.material.color.setRGB(...color, THREE.LinearSRGBColorSpace);
    this.object = new THREE.Mesh(new THREE.BufferGeometry(), this.material);
    this.object.receiveShadow = true;
    this.object.frustumCulled = false;
  }

  set(position: Numbers, triangles: Numbers): void {
    this.object.geometry.dispose();
    this.object.geometry = triangulated(position, triangles);
    this.object.geometry.computeVertexNormals();
  }

  dispose(): void {
    release(this.object);
  }
}

/** Edges that bend more than this are drawn sharp on solids [rad]. */
const SHARP = 0.6;

export function triangulated(position: Numbers, triangles: Numbers): THREE.BufferGeometry {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(Float32Array.from(position), 3));
  geometry.setIndex(new THREE.BufferAttribute(Uint32Array.from(triangles), 1));
  return geometry;
}

/** Triangles with the normals of a solid. */
export const edged = (position: Numbers, triangles: Numbers): THREE.BufferGeometry =>
  toCreasedNormals(triangulated(position, triangles), SHARP);

/** A surface of triangles, seen from both sides. */
export class Surface implements Layer {
  readonly object: THREE.Mesh;
  private readonly material: THREE.MeshStandardMaterial;
  private triangles: Numbers;

  constructor(position: Numbers, triangles: Numbers, color: Rgb, { moving = true, flat = false, plain = false } = {}) {
    this.triangles = triangles;
    this.material = new THREE.MeshStandardMaterial({ roughness: 0.75, metalness: 0, side: THREE.DoubleSide, flatShading: flat && moving });
    this.material.color.setRGB(...color, THREE.LinearSRGBColorSpace);
    // Seen head-on, light would only tell that a disk is a ball.
    if (plain) {
      this.material.emissive.copy(this.material.color);
      this.material.color.set(0);
    }
    const geometry = moving ? triangulated(position, triangles) : edged(position, triangles);
    if (moving) {
      geometry.computeVertexNormals();
      (geometry.getAttribute("position") as THREE.BufferAttribute).setUsage(THREE.DynamicDrawUsage);
    }
    this.object = new THREE.Mesh(geometry, this.material);
    this.object.castShadow = this.object.receiveShadow = true;
    this.object.frustumCulled = false;
  }

  /** New places of the vertices; `torn` are pairs of vertices across which nothing is drawn; `triangles` are those of a surface that tears. */
  set(position: Numbers, torn?: Set<number>, triangles?: Numbers): void {
    const g = this.object.geometry;
    const p = g.getAttribute("position") as THREE.BufferAttribute;
    if (p.array.length !== position.length) return;
    p.array.set(position);
    p.needsUpdate = true;
    if (triangles) {
      (g.getIndex()!.array as Uint32Array).set(triangles);
      g.getIndex()!.needsUpdate = true;
    } else if (torn?.size) {
      const n = position.length / 3;
      const t = this.triangles;
      const whole: number[] = [];
      for (let i = 0; i < t.length; i += 3) {
        const gone = [0, 1, 2].some((k) => {
          const a = t[i + k];
          const b = t[i + ((k + 1) % 3)];
          return torn.has(Math.min(a, b) * n + Math.max(a, b));
        });
        if (!gone) whole.push(t[i], t[i + 1], t[i + 2]);
      }
      g.setIndex(whole);
    }
    g.computeVertexNormals();
  }

  /** Colours of the vertices, three numbers each; without them the colour of the object. */
  paint(colors: Float32Array | null): void {
    const g = this.object.geometry;
    if (colors) {
      const old = g.getAttribute("color") as THREE.BufferAttribute | undefined;
      if (old && old.array.length === colors.length) {
        old.array.set(colors);
        old.needsUpdate = true;
      } else g.setAttribute("color", new THREE.BufferAttribute(colors, 3));
    }
    if (this.material.vertexColors !== !!colors) {
      this.material.vertexColors = !!colors;
      this.material.needsUpdate = true;
    }
  }

  /** Lets one see through it, and through to what lies in the same place. */
  veil(opacity: number): void {
    Object.assign(this.material, { ...BEHIND, transparent: true, depthWrite: false, opacity });
    this.object.castShadow = this.object.receiveShadow = false;
  }

  tint(color: Rgb): void {
    this.material.color.setRGB(...color, THREE.LinearSRGBColorSpace);
  }

  dispose(): void {
    release(this.object);
  }
}

/** Position of a grid. */
export interface Grid {
  cells: [number, number, number];
  spacing: number;
  origin: [number, number, number];
  /** The axis across a plane; 3 in space. */
  flat: number;
}

export function gridOf(topology: Record<string, Column>): Grid | null {
  if (!topology.grid_cells) return null;
  const flat = topology.grid_flat.data[0];
  const cells: [number, number, number] = [1, 1, 1];
  const axes = [0, 1, 2].filter((a) => a !== flat);
  axes.forEach((axis, i) => (cells[axis] = topology.grid_cells.data[i]));
  const origin = [...topology.grid_origin.data] as [number, number, number];
  return { cells, spacing: topology.grid_spacing.data[0], origin, flat };
}

/** One number for each cell: lengths of vectors. */
export function scalars(column: Column): Numbers {
  const { data, width } = column;
  if (width === 1) return data;
  const n = data.length / width;
  const out = new Float32Array(n);
  for (let i = 0; i < n; i++) {
    let sum = 0;
    for (let d = 0; d < width; d++) sum += data[width * i + d] ** 2;
    out[i] = Math.sqrt(sum);
  }
  return out;
}

/** From where to where the colours of a field run, around zero where it is signed: grows at once, shrinks slowly. */
export class Range {
  low = 0;
  high = 0;
  private fresh = true;

  constructor(private readonly signed: boolean) {}

  look(values: Numbers): void {
    let low = Infinity;
    let high = -Infinity;
    for (let i = 0; i < values.length; i++) {
      const v = values[i];
      if (v < low) low = v;
      if (v > high) high = v;
    }
    if (!Number.isFinite(low) || !Number.isFinite(high)) return;
    if (this.signed) {
      // A few cells beside walls are far off the rest. An odd stride does not stay in a few columns of the grid.
      const step = Math.floor(values.length / 4096) | 1;
      const seen: number[] = [];
      for (let i = step >> 1; i < values.length; i += step) if (Number.isFinite(values[i])) seen.push(values[i]);
      seen.sort((a, b) => a - b);
      const at = (q: number) => seen[Math.min(Math.floor(q * seen.length), seen.length - 1)];
      high = Math.max(Math.abs(at(0.01)), Math.abs(at(0.99)), 0.25 * Math.max(-low, high));
      low = -high;
    } else if (low >= 0 && low < 0.5 * high) {
      low = 0;
    }
    if (this.fresh) [this.low, this.high] = [low, high];
    else {
      this.low = Math.min(low, this.low + 0.02 * (low - this.low));
      this.high = Math.max(high, this.high + 0.02 * (high - this.high));
    }
    if (high > low) this.fresh = false;
  }

  /** Never empty, for shaders. */
  get pair(): [number, number] {
    return this.high > this.low ? [this.low, this.high] : [this.low - 1, this.low + 1];
  }
}

const MAP_TEXTURES = new Map<MapName, THREE.DataTexture>();

function mapTexture(name: MapName): THREE.DataTexture {
  let texture = MAP_TEXTURES.get(name);
  if (!texture) {
    texture = new THREE.DataTexture(table(name), 256, 1, THREE.RGBAFormat);
    texture.colorSpace = THREE.SRGBColorSpace;
    texture.minFilter = texture.magFilter = THREE.LinearFilter;
    texture.needsUpdate = true;
    MAP_TEXTURES.set(name, texture);
  }
  return texture;
}

/** A field in a plane. */
export class PlaneField implements Layer {
  readonly object: THREE.Mesh;
  private readonly material: THREE.ShaderMaterial;
  private texture: THREE.DataTexture;

  constructor(grid: Grid, ink: Rgb) {
    const [a, b] = [0, 1, 2].filter((axis) => axis !== grid.flat);
    const n = grid.cells[a];
    const m = grid.cells[b];
    const size = [n * grid.spacing, m * grid.spacing];
    const middle = grid.origin.map((o, axis) => o + 0.5 * grid.cells[axis] * grid.spacing);
    const corner = (u: number, v: number): number[] => {
      const p = [...middle];
      p[a] = grid.origin[a] + u * size[0];
      p[b] = grid.origin[b] + v * size[1];
      return p;
    };
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.Float32BufferAttribute([corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)].flat(), 3));
    geometry.setAttribute("uv", new THREE.Float32BufferAttribute([0, 0, 1, 0, 1, 1, 0, 1], 2));
    geometry.setIndex([0, 1, 2, 0, 2, 3]);
    this.texture = new THREE.DataTexture(new Float32Array(n * m), n, m, THREE.RedFormat, THREE.FloatType);
    this.material = new THREE.ShaderMaterial({
      vertexShader: PLANE.vertex,
      fragmentShader: PLANE.fragment,
      uniforms: {
        values: { value: this.texture },
        cells: { value: new THREE.Vector2(n, m) },
        smoothly: { value: true },
        lines: { value: false },
        map: { value: mapTexture("viridis") },
        range: { value: new THREE.Vector2(0, 1) },
        dye: { value: false },
        ink: { value: new THREE.Vector3(...ink) },
      },
      transparent: true,
      depthWrite: false,
      side: THREE.DoubleSide,
    });
    this.object = new THREE.Mesh(geometry, this.material);
    this.object.frustumCulled = false;
    this.object.renderOrder = -1;
  }

  set(
    name: string,
    values: Numbers,
    range: [number, number],
    { dye, smoothly, lines }: { dye: boolean; smoothly: boolean; lines: boolean },
  ): void {
    const data = this.texture.image.data as Float32Array;
    if (values.length !== data.length) return;
    data.set(values);
    this.texture.needsUpdate = true;
    const u = this.material.uniforms;
    u.map.value = mapTexture(mapOf(name));
    u.range.value.set(...range);
    u.dye.value = dye;
    u.smoothly.value = smoothly;
    u.lines.value = lines;
  }

  dispose(): void {
    this.texture.dispose();
    release(this.object);
  }
}

/** Bytes, which every browser can filter: shares of the range between the smallest and the largest value. */
function bytes(values: Numbers, low: number, high: number, out: Uint8Array<ArrayBuffer>): void {
  const scale = 255 / (high - low);
  for (let i = 0; i < values.length; i++) {
    const s = (values[i] - low) * scale;
    out[i] = s < 0 ? 0 : s > 255 ? 255 : s + 0.5;
  }
}

/** A field in space: smoke, and a slice through it. */
export class SpaceField implements Layer {
  readonly object = new THREE.Group();
  private readonly smoke: THREE.Mesh<THREE.BufferGeometry, THREE.ShaderMaterial>;
  private readonly slice: THREE.Mesh<THREE.BufferGeometry, THREE.ShaderMaterial>;
  private readonly texture: THREE.Data3DTexture;
  private readonly heat: THREE.Data3DTexture;
  private readonly low: THREE.Vector3;
  private readonly extent: THREE.Vector3;
  private readonly viewer = new THREE.Vector3();
  private readonly parallel = new THREE.Vector3();
  private readonly unproject = new THREE.Matrix4();

  constructor(grid: Grid, ink: Rgb) {
    const [nx, ny, nz] = grid.cells;
    const volume = () => {
      const made = new THREE.Data3DTexture(new Uint8Array(nx * ny * nz), nx, ny, nz);
      made.format = THREE.RedFormat;
      made.type = THREE.UnsignedByteType;
      made.minFilter = made.magFilter = THREE.LinearFilter;
      made.unpackAlignment = 1;
      made.needsUpdate = true;
      return made;
    };
    this.texture = volume();
    this.heat = volume();
    this.low = new THREE.Vector3(...grid.origin);
    this.extent = new THREE.Vector3(nx, ny, nz).multiplyScalar(grid.spacing);
    const shared = {
      values: { value: this.texture },
      low: { value: this.low },
      extent: { value: this.extent },
      ink: { value: new THREE.Vector3(...ink) },
    };
    const mean = (this.extent.x + this.extent.y + this.extent.z) / 3;
    const box = new THREE.BoxGeometry(this.extent.x, this.extent.y, this.extent.z);
    this.smoke = new THREE.Mesh(
      box,
      new THREE.ShaderMaterial({
        vertexShader: SPACE.vertex,
        fragmentShader: SPACE.smoke,
        uniforms: {
          ...shared,
          ...SOLIDS,
          size: PIXELS,
          unproject: { value: this.unproject },
          viewer: { value: this.viewer },
          parallel: { value: this.parallel },
          thick: { value: 40 / mean },
          fire: { value: false },
          heat: { value: this.heat },
        },
        transparent: true,
        // The way through it ends where something solid begins; its far sides are seen from within, too.
        depthWrite: false,
        depthTest: false,
        side: THREE.BackSide,
      }),
    );
    this.smoke.position.copy(this.low).addScaledVector(this.extent, 0.5);
    this.smoke.onBeforeRender = (_renderer, _scene, camera) => {
      camera.getWorldPosition(this.viewer);
      if ((camera as THREE.OrthographicCamera).isOrthographicCamera) camera.getWorldDirection(this.parallel);
      else this.parallel.set(0, 0, 0);
      this.unproject.copy(camera.projectionMatrixInverse);
    };
    const sheet = new THREE.BufferGeometry();
    sheet.setAttribute("position", new THREE.Float32BufferAttribute(new Float32Array(12), 3));
    sheet.setIndex([0, 1, 2, 0, 2, 3]);
    this.slice = new THREE.Mesh(
      sheet,
      new THREE.ShaderMaterial({
        vertexShader: SPACE.vertex,
        fragmentShader: SPACE.slice,
        uniforms: {
          ...shared,
          stored: { value: new THREE.Vector2(0, 1) },
          cells: { value: new THREE.Vector3(nx, ny, nz) },
          lines: { value: false },
          range: { value: new THREE.Vector2(0, 1) },
          map: { value: mapTexture("viridis") },
          dye: { value: false },
        },
        side: THREE.DoubleSide,
      }),
    );
    const edges = new THREE.LineSegments(
      new THREE.EdgesGeometry(box),
      new THREE.LineBasicMaterial({ color: 0x808890, transparent: true, opacity: 0.45 }),
    );
    edges.position.copy(this.smoke.position);
    this.object.add(edges, this.smoke, this.slice);
    for (const mesh of [this.smoke, this.slice]) mesh.frustumCulled = false;
    this.cut(null, 0.5);
  }

  /** Shows a slice across an axis, at a share of its length, with its cells or smooth; without an axis the smoke. */
  cut(axis: number | null, share: number, cells = false): void {
    this.slice.material.uniforms.lines.value = cells;
    this.smoke.visible = axis === null;
    this.slice.visible = axis !== null;
    if (axis === null) return;
    const [a, b] = [0, 1, 2].filter((k) => k !== axis);
    const corner = (u: number, v: number) => {
      const p = [0, 0, 0];
      p[axis] = share;
      p[a] = u;
      p[b] = v;
      return [this.low.x + p[0] * this.extent.x, this.low.y + p[1] * this.extent.y, this.low.z + p[2] * this.extent.z];
    };
    const position = this.slice.geometry.getAttribute("position") as THREE.BufferAttribute;
    position.array.set([corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)].flat());
    position.needsUpdate = true;
  }

  /** `hot` are temperatures as shares of a glow, where there are any. */
  set(name: string, values: Numbers, range: [number, number], hot?: { values: Numbers; low: number; high: number }): void {
    const data = this.texture.image.data as Uint8Array<ArrayBuffer>;
    if (values.length !== data.length) return;
    bytes(values, range[0], range[1], data);
    this.texture.needsUpdate = true;
    this.slice.material.uniforms.stored.value.set(...range);
    this.slice.material.uniforms.range.value.set(...range);
    this.slice.material.uniforms.map.value = mapTexture(mapOf(name));
    this.smoke.material.uniforms.fire.value = !!hot;
    if (hot) {
      bytes(hot.values, hot.low, hot.high, this.heat.image.data as Uint8Array<ArrayBuffer>);
      this.heat.needsUpdate = true;
    }
  }

  dispose(): void {
    this.texture.dispose();
    this.heat.dispose();
    release(this.object);
  }
}
