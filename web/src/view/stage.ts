/** The picture of a world: objects in layers, a camera, light. It draws when something has changed, never by itself. */
import * as THREE from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { DRAWN_ON, FOG, GLOWING, GROUND, MATTER, SHADE, SIGNED, SOLID, SPRING, TRAIL } from "../engine/looks";
import type { Column, Frame, Numbers, SceneInfo, Sight, Vector } from "../engine/protocol";
import { FAMILIES, familiesOf, isOn, linked } from "../links";
import { Depths } from "./depths";
import { Instances } from "./instances";
import {
  type Grid,
  gridOf,
  type Layer,
  PIXELS,
  Pieces,
  PlaneField,
  Points,
  Range,
  type Rgb,
  SpaceField,
  Surface,
  scalars,
  Water,
} from "./layers";
import { LOOK, type Look } from "./look";
import { along, arrows, carry, ground, outline, sharp, shownOf } from "./scenery";
import { isLeft, type Legend, Shades } from "./shades";
import { isLine, isSkin, isSolid, type Thing } from "./thing";
import { trails } from "./trails";
import { fitting, lit } from "./vantage";

type Entry = Record<string, any>;

export class Stage {
  readonly renderer: THREE.WebGLRenderer;
  readonly scene = new THREE.Scene();
  private camera: THREE.PerspectiveCamera | THREE.OrthographicCamera = new THREE.PerspectiveCamera(35, 1, 0.01, 1000);
  private controls: OrbitControls;
  private things: Thing[] = [];
  private info: SceneInfo | null = null;
  private frame: Frame | null = null;
  private past: (index: number) => Frame | undefined = () => undefined;
  private reach = 1;
  /** The scene's camera: where it stands, what it looks at, the width that its picture shows there [m], and that over its height. */
  private home = { position: new THREE.Vector3(), target: new THREE.Vector3(), width: 1, shape: 16 / 9 };
  /** All that must fit, as the camera was placed. */
  private box = new THREE.Box3(new THREE.Vector3(-1, -1, -1), new THREE.Vector3(1, 1, 1));
  /** The way to the light, in spans of what is seen: that of a camera that moves stands. */
  private shine = new THREE.Vector3(0, 0, 1);
  /** Whether the scene's camera moves that of the page, which nobody has turned. */
  private follows = true;
  private dirty = false;
  private readonly light = new THREE.DirectionalLight(0xffffff, 2.1);
  private readonly sky = new THREE.HemisphereLight(0xffffff, 0xb8b2a8, 1.25);
  private readonly observer: ResizeObserver;
  private anchors: { pieces: Pieces; ends: [string, number][] } | null = null;
  private readonly depths = new Depths();
  private readonly handle = new Pieces(0, { lit: false, thinnest: 1.5, front: true });
  private shades = new Shades();
  look: Look = { ...LOOK };
  legend: Legend | null = null;
  /** Called after each picture. */
  drawn: () => void = () => {};
  /** Called when the browser takes the graphics away, and when it gives them back. */
  onlost: (lost: boolean) => void = () => {};
  private lost = false;

  constructor(
    readonly canvas: HTMLCanvasElement,
    /** Whether pointers may turn the camera; where they do not, there is nothing to throw a shadow. */
    private readonly turns = true,
  ) {
    this.renderer = new THREE.WebGLRenderer({
      canvas,
      antialias: true,
      alpha: true,
      preserveDrawingBuffer: false,
      powerPreference: "high-performance",
    });
    this.renderer.shadowMap.enabled = turns;
    this.renderer.shadowMap.type = THREE.PCFShadowMap;
    this.renderer.toneMapping = THREE.NoToneMapping;
    this.light.castShadow = turns;
    this.light.shadow.mapSize.set(1024, 1024);
    this.light.shadow.radius = 4;
    this.light.shadow.bias = -0.0005;
    this.light.shadow.normalBias = 0.02;
    this.scene.add(this.light, this.light.target, this.sky, this.handle.object);
    this.controls = this.controlled();
    canvas.addEventListener("webglcontextlost", this.losing);
    canvas.addEventListener("webglcontextrestored", this.losing);
    this.observer = new ResizeObserver(() => this.resize());
    this.observer.observe(canvas.parentElement ?? canvas);
  }

  private readonly losing = (event: Event): void => {
    this.lost = event.type === "webglcontextlost";
    this.onlost(this.lost);
    this.touch();
  };

  private controlled(): OrbitControls {
    const controls = new OrbitControls(this.camera, this.canvas);
    controls.enableDamping = false;
    controls.enabled = this.turns;
    let held = false;
    controls.addEventListener("start", () => (held = true));
    controls.addEventListener("end", () => (held = false));
    controls.addEventListener("change", () => {
      if (held) this.follows = false;
      this.touch();
    });
    return controls;
  }

  dispose(): void {
    this.observer.disconnect();
    for (const name of ["webglcontextlost", "webglcontextrestored"]) this.canvas.removeEventListener(name, this.losing);
    this.clear();
    this.handle.dispose();
    this.depths.dispose();
    this.controls.dispose();
    this.renderer.dispose();
    this.renderer.forceContextLoss();
    this.info = this.frame = null;
    this.dirty = false;
  }

  private clear(): void {
    for (const thing of this.things) {
      for (const layer of [thing.body, thing.links, thing.way, thing.arrows]) {
        if (!layer) continue;
        this.scene.remove((layer as Layer).object);
        layer.dispose();
      }
      if (thing.plane) {
        this.scene.remove(thing.plane);
        thing.plane.geometry.dispose();
        (thing.plane.material as THREE.Material).dispose();
      }
    }
    if (this.anchors) {
      this.scene.remove(this.anchors.pieces.object);
      this.anchors.pieces.dispose();
      this.anchors = null;
    }
    this.things = [];
  }

  get night(): boolean {
    return (this.info?.scene.camera as Entry | undefined)?.look === "night";
  }

  get flat(): boolean {
    return this.info?.dimension === 2;
  }

  /** The first gas. */
  private get gas(): { name: string; grid: Grid } | null {
    const object = this.info?.objects.find((o) => o.kind === "gas");
    const thing = this.things.find((t) => t.name === object?.name && t.grid);
    return thing?.grid ? { name: thing.name, grid: thing.grid } : null;
  }

  /**
   * The gas that a pointer stirs, and a point of the plane in which it does where that is not the gas itself: in space it is a slice, which
   * stands before a camera that does not turn.
   */
  get stirred(): { name: string; through?: THREE.Vector3 } | null {
    const gas = this.gas;
    if (!gas || this.flat) return gas && { name: gas.name };
    const { slice, sliceAt } = this.look;
    if (slice === null || this.turns) return null;
    const { origin, spacing, cells } = gas.grid;
    const [x, y, z] = [0, 1, 2].map((a) => origin[a] + (a === slice ? sliceAt : 0.5) * cells[a] * spacing);
    return { name: gas.name, through: new THREE.Vector3(x, y, z) };
  }

  /** Whether ways behind particles are drawn. */
  get trails(): boolean {
    return this.things.some((t) => t.trail > 0);
  }

  /** Columns that the look asks for beside those of the scene. */
  get wanted(): string[] {
    const names = new Set<string>(this.info?.columns ?? []);
    for (const thing of this.things) {
      if (thing.grid) {
        if (this.look.arrows || this.look.field === "speed") names.add("velocity");
        if (this.look.field && this.look.field !== "speed") names.add(this.look.field);
      } else if (MATTER[thing.form] === "masses") {
        names.add("position");
        if (this.look.color === "speed") names.add("velocity");
        if (this.look.color === "strain") names.add("link_strain");
      }
    }
    return [...names];
  }

  /** A new world. The camera stays where it is if the world is another version of the one before. */
  open(info: SceneInfo, past: (index: number) => Frame | undefined, keepCamera = false): void {
    this.clear();
    this.info = info;
    this.past = past;
    this.frame = null;
    this.shades = new Shades();
    for (const { object: name, form, color, radius, trail, leap, plane, few } of info.looks.objects) {
      const object = info.objects.find((o) => o.name === name);
      const topology = info.topology[name] ?? {};
      const thing: Thing = {
        name,
        form,
        color,
        radius,
        trail,
        leap: leap ?? Infinity,
        topology,
        grid: gridOf(topology),
        families: object ? familiesOf(info, object) : null,
        acting: [],
        ranges: new Map(),
        at: plane ? [new THREE.Vector3(...plane[0]), new THREE.Vector3(...plane[1])] : undefined,
      };
      const { grid } = thing;
      const { position, triangles } = topology;
      if (form === "image" && grid) thing.body = new PlaneField(grid, color);
      else if (form === "smoke" && grid) thing.body = new SpaceField(grid, color);
      else if (form === "solid" && position && triangles) {
        thing.body = new Surface(position.data, triangles.data, color, { moving: false, plain: info.dimension === 2 });
      } else if (form === "container" && position && triangles) {
        thing.body = new Pieces(0, { thinnest: 1, lit: false });
        thing.body.pairs(position.data, sharp(position.data, triangles.data), color);
      } else if (form === "instances") {
        thing.body = new Instances(topology, color, this.flat);
      } else if (form === "points") {
        thing.body = new Points(this.night, few ? 3.5 : 1.5);
        if (trail > 0) this.add((thing.way = new Pieces(TRAIL * radius, { lit: false, glow: this.night, thinnest: 0.8 })));
      } else if (isLine(form)) {
        thing.body = new Pieces(radius, { thinnest: 1.5 });
      } else if (form === "liquid") {
        thing.body = new Water(color);
      } else if (form === "ground") {
        this.scene.add((thing.plane = ground()));
      }
      if (thing.body) this.add(thing.body);
      if (topology.links?.data.length)
        this.add(
          (thing.links = new Pieces(form === "points" ? SPRING * radius : 0, {
            thinnest: isLine(form) ? 2 : form === "points" || topology.links.data.length < 8000 ? 1.2 : 0.7,
            lit: form === "points",
          })),
        );
      if (form === "image" && grid) {
        this.add((thing.way = new Pieces(0, { lit: false, thinnest: 0.6 })));
        outline(thing.way, grid);
      }
      if (form === "image") this.add((thing.arrows = new Pieces(0, { lit: false, thinnest: 1.1, front: true })));
      this.things.push(thing);
    }
    this.changed(info);
    this.theme();
    this.frameCamera(keepCamera);
  }

  /** The same objects with other values. */
  changed(info: SceneInfo): void {
    this.info = info;
    const own = linked(info);
    for (const thing of this.things) thing.acting = FAMILIES.map((f) => isOn(own.find((l) => l.name === thing.name)?.families[f]));
    const ends = info.looks.anchors.flat();
    if (!this.anchors && ends.length) this.add((this.anchors = { pieces: new Pieces(0, { thinnest: 1.5 }), ends }).pieces);
    if (this.anchors) this.anchors.ends = ends;
  }

  private add(layer: Layer): void {
    this.scene.add(layer.object);
  }

  /** Light and ground follow the colours of the page. */
  theme(): void {
    const dark = this.dark;
    this.sky.intensity = dark ? 0.85 : 1.35;
    this.sky.groundColor.set(dark ? 0x2a2a30 : 0xb8b2a8);
    this.light.intensity = dark ? 1.6 : 1.9;
    for (const thing of this.things) {
      if (!thing.plane) continue;
      const m = thing.plane.material as THREE.MeshStandardMaterial;
      const own = thing.color.some((c, i) => Math.abs(c - GROUND[i]) > 1e-6);
      if (dark && !own) m.color.setRGB(0.06, 0.066, 0.075, THREE.LinearSRGBColorSpace);
      else m.color.setRGB(...thing.color, THREE.LinearSRGBColorSpace);
    }
    this.touch();
  }

  private get dark(): boolean {
    return this.night || document.documentElement.dataset.theme === "dark";
  }

  /** Bounds of what must fit. */
  private bounds(): THREE.Box3 {
    const box = new THREE.Box3();
    const point = new THREE.Vector3();
    const take = (x: Numbers) => {
      for (let i = 0; i + 2 < x.length; i += 3)
        if (Number.isFinite(x[i] + x[i + 1] + x[i + 2])) box.expandByPoint(point.set(x[i], x[i + 1], x[i + 2]));
    };
    const columns = this.frame?.columns ?? {};
    for (const thing of this.things) {
      if (thing.grid) {
        const { origin, cells, spacing, flat } = thing.grid;
        const low = new THREE.Vector3(...origin);
        const high = low.clone().add(new THREE.Vector3(...cells).multiplyScalar(spacing));
        if (flat < 3) {
          const middle = 0.5 * (low.getComponent(flat) + high.getComponent(flat));
          low.setComponent(flat, middle);
          high.setComponent(flat, middle);
        }
        box.expandByPoint(low).expandByPoint(high);
      } else if (isSolid(thing.form) && thing.topology.position) {
        take(thing.topology.position.data);
      } else {
        const own = columns[thing.name];
        if (own?.position && thing.body instanceof Instances) {
          thing.body.set(own);
          thing.body.expand(box);
        } else if (own?.position) take(own.position.data);
      }
    }
    if (box.isEmpty()) box.set(new THREE.Vector3(-1, -1, -1), new THREE.Vector3(1, 1, 1));
    return box;
  }

  private frameCamera(keep: boolean): void {
    if (!this.info) return;
    this.box = this.bounds();
    this.reach = Math.max(this.box.getSize(new THREE.Vector3()).length() * 0.5, 1e-6);
    const { flat } = this;
    const wasFlat = !!(this.camera as THREE.OrthographicCamera).isOrthographicCamera;
    if (keep && wasFlat === flat) return;
    if (wasFlat !== flat) {
      this.controls.dispose();
      this.camera = flat ? new THREE.OrthographicCamera() : new THREE.PerspectiveCamera(35, 1, 0.01, 1000);
      this.controls = this.controlled();
      this.controls.enableRotate = !flat;
    }
    this.place();
    this.shine.copy(lit(this.home.position.clone().sub(this.home.target)));
    this.goHome();
    this.resize();
  }

  /** What the scene says of its camera at the frame that is shown. */
  private get sight(): Sight {
    if (this.frame?.sight) return this.frame.sight;
    const words = (this.info?.scene.camera ?? {}) as Entry;
    // Keys and formulas are known once there is a frame.
    const point = (of: unknown) => (Array.isArray(of) && of.every((x) => typeof x === "number") ? (of as Vector) : null);
    const angle = typeof words.view_angle === "number" ? words.view_angle : 35;
    return { position: point(words.position), target: point(words.target), view_angle: angle };
  }

  /** Finds where the scene's camera stands now. */
  private place(): void {
    const { box, sight } = this;
    const middle = box.getCenter(new THREE.Vector3());
    const size = box.getSize(new THREE.Vector3());
    const tan = Math.tan((0.5 * sight.view_angle * Math.PI) / 180);
    const wish = sight.position && new THREE.Vector3(...sight.position);
    const goal = sight.target ? new THREE.Vector3(...sight.target) : middle;
    const [w, hgt] = this.size();
    const [across, down] = ((this.info?.scene.camera as Entry | undefined)?.resolution ?? [16, 9]) as [number, number];
    const shape = across / down;
    if (this.flat) {
      const top = this.info?.plane === "xy";
      this.camera.up.set(0, top ? 1 : 0, top ? 0 : 1);
      const tall = top ? size.y : size.z;
      // With grids all of them must be seen, as large as they can.
      const grids = this.things.some((t) => t.grid);
      const width = wish && !grids ? 2 * tan * wish.distanceTo(goal) : Math.max(size.x, (tall * w) / hgt) * (grids ? 1.02 : 1.12);
      this.home = {
        position: goal.clone().add(top ? new THREE.Vector3(0, 0, 10 * this.reach + 1) : new THREE.Vector3(0, -10 * this.reach - 1, 0)),
        target: goal.clone(),
        width,
        // What is fitted is fitted to this window.
        shape: wish && !grids ? shape : w / hgt,
      };
      return;
    }
    this.camera.up.set(0, 0, 1);
    let position = wish ?? fitting(goal, size, tan, shape);
    if (position.distanceTo(goal) < 1e-9) position.y -= 1;
    // Straight from above there is no up; a hair beside it there is.
    const way = goal.clone().sub(position);
    if (Math.hypot(way.x, way.y) < 1e-6 * way.length()) position = position.clone().add(new THREE.Vector3(0, -1e-3 * way.length(), 0));
    const distance = position.distanceTo(goal);
    this.home = { position: position.clone(), target: goal.clone(), width: 2 * tan * distance, shape };
    (this.camera as THREE.PerspectiveCamera).near = distance * 0.01;
    (this.camera as THREE.PerspectiveCamera).far = distance * 60;
  }

  /** Back to the camera of the scene, which the picture then follows where it moves. */
  goHome(): void {
    this.follows = true;
    if (this.frame?.sight) this.place();
    this.camera.position.copy(this.home.position);
    this.controls.target.copy(this.home.target);
    this.camera.zoom = 1;
    const { target } = this.home;
    const span = Math.max(this.seen * 0.75, 1e-6);
    this.light.position.copy(target).addScaledVector(this.shine, span);
    this.light.target.position.copy(target);
    const s = this.light.shadow.camera;
    s.left = s.bottom = -span;
    s.right = s.top = span;
    s.near = 0.01 * span;
    s.far = 5 * span;
    s.updateProjectionMatrix();
    this.controls.update();
    this.lens();
  }

  /** Width that the window shows at the target [m]: all of the scene's picture, whose shape may be another. */
  private get seen(): number {
    const [w, hgt] = this.size();
    return this.home.width * Math.max(1, w / hgt / this.home.shape);
  }

  private size(): [number, number] {
    const host = this.canvas.parentElement ?? this.canvas;
    return [Math.max(host.clientWidth, 16), Math.max(host.clientHeight, 16)];
  }

  resize(): void {
    const [w, hgt] = this.size();
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    this.renderer.setPixelRatio(ratio);
    this.renderer.setSize(w, hgt, false);
    this.lens();
  }

  /** Shows as much as the scene's camera, in the shape of the window. */
  private lens(): void {
    const [w, hgt] = this.size();
    const aspect = w / hgt;
    if (this.camera instanceof THREE.OrthographicCamera) {
      const half = 0.5 * Math.max(this.seen, 1e-9);
      // An element as wide as the box may be taller than the window.
      const box = this.bounds().getSize(new THREE.Vector3());
      const tall = this.info?.plane === "xy" ? box.y : box.z;
      const grids = this.things.some((t) => t.grid);
      const wide = grids ? Math.max(box.x, tall * aspect) * 0.51 : half;
      this.camera.left = -wide;
      this.camera.right = wide;
      this.camera.top = wide / aspect;
      this.camera.bottom = -wide / aspect;
      this.camera.near = -1e3 * this.reach;
      this.camera.far = 1e3 * this.reach + 100;
    } else {
      const tan = (0.5 * this.seen) / Math.max(this.home.position.distanceTo(this.home.target), 1e-9);
      this.camera.fov = (2 * Math.atan(tan / aspect) * 180) / Math.PI;
      this.camera.aspect = aspect;
    }
    this.camera.updateProjectionMatrix();
    this.touch();
  }

  /** Asks for a picture. */
  touch(): void {
    if (this.dirty) return;
    this.dirty = true;
    requestAnimationFrame(() => {
      if (!this.dirty) return;
      this.render();
    });
  }

  render(): void {
    this.dirty = false;
    if (this.lost) return;
    this.renderer.getDrawingBufferSize(PIXELS.value);
    this.depths.draw(this.renderer, this.scene, this.camera, PIXELS.value);
    this.renderer.render(this.scene, this.camera);
    this.drawn();
  }

  /** Shows a frame. */
  show(frame: Frame): void {
    const first = this.frame === null;
    this.frame = frame;
    if (frame.sight && this.follows) {
      if (first) this.frameCamera(false);
      else this.goHome();
    }
    this.shades.take(this.things, frame, this.look.color, this.look.unseen, this.look.links);
    this.legend = this.shades.legend;
    const far = Math.max(this.seen * 1.6, 1e-6);
    for (const thing of this.things) {
      const columns = frame.columns[thing.name] ?? {};
      if (thing.plane && thing.at) {
        const [point, normal] = thing.at;
        const p = point.clone();
        const n = normal.clone();
        carry(columns, p, n);
        const foot = this.home.target.clone().addScaledVector(n, -this.home.target.clone().sub(p).dot(n));
        thing.plane.position.copy(foot);
        thing.plane.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), n);
        thing.plane.scale.setScalar(far);
      } else if (isSolid(thing.form)) this.solid(thing, columns);
      else if (thing.grid) this.field(thing, thing.grid, columns);
      else if (!this.look.hidden.includes(thing.name)) this.masses(thing, columns, frame);
    }
    if (this.anchors) {
      const ends = this.anchors.ends.map(([name, row]) => {
        const x = frame.columns[name]?.position?.data;
        return x ? [x[3 * row], x[3 * row + 1], x[3 * row + 2]] : [0, 0, 0];
      });
      this.anchors.pieces.pairs(Float32Array.from(ends.flat()), Uint32Array.from(ends.keys()), SOLID);
    }
    if (first && !frame.sight) {
      const words = (this.info?.scene.camera ?? {}) as Entry;
      if (!words.position || this.flat) this.frameCamera(false);
    }
    this.touch();
  }

  /** Shows the frame once more: the look has changed. */
  again(): void {
    if (this.frame) this.show(this.frame);
  }

  private solid(thing: Thing, columns: Record<string, Column>): void {
    if (!thing.body) return;
    const object = thing.body.object;
    const x = columns.position?.data;
    if (x && thing.body instanceof Surface && x.length === thing.topology.position?.data.length) {
      this.scene.remove(object);
      thing.body.dispose();
      thing.body = new Surface(x, thing.topology.triangles.data, thing.color, { moving: false, plain: this.flat });
      this.add(thing.body);
    }
    // A container that changes its size.
    if (x && thing.body instanceof Pieces && thing.topology.triangles)
      thing.body.pairs(x, sharp(x, thing.topology.triangles.data), thing.color);
    if (columns.turn) {
      const q = columns.turn.data;
      const t = columns.translation?.data ?? [0, 0, 0];
      thing.body.object.quaternion.set(q[0], q[1], q[2], q[3]);
      thing.body.object.position.set(t[0], t[1], t[2]);
    }
  }

  private field(thing: Thing, grid: Grid, columns: Record<string, Column>): void {
    const name = shownOf(columns, this.look.field);
    if (!name) return;
    const column = columns[name] ?? columns.velocity;
    const signed = (SIGNED.includes(name) || name === "difference") && column.width === 1;
    let values = scalars(column);
    // There is no less smoke than none.
    const sizes = grid.flat === 3 && signed && this.look.slice === null;
    if (sizes) values = values.map((v) => Math.abs(v));
    const key = sizes ? `size of ${name}` : name;
    let range = thing.ranges.get(key);
    if (!range) thing.ranges.set(key, (range = new Range(signed && !sizes)));
    range.look(values);
    const [low, high] = range.pair;
    this.legend = { name, unit: column.unit, low, high };
    if (thing.body instanceof PlaneField) {
      const dye = this.look.dye && FOG.includes(name) && low === 0;
      if (dye) this.legend = null;
      thing.body.set(name, values, [low, high], { dye, smoothly: !this.look.cells, lines: this.look.cells });
    } else if (thing.body instanceof SpaceField) {
      const warm = columns.temperature;
      let hot: { values: Numbers; low: number; high: number } | undefined;
      if (warm) {
        let heat = thing.ranges.get("heat");
        if (!heat) thing.ranges.set("heat", (heat = new Range(false)));
        heat.look(warm.data);
        if (heat.high > GLOWING) hot = { values: warm.data, low: 0, high: Math.max(heat.high, 1) };
      }
      thing.body.cut(this.look.slice, this.look.sliceAt, this.look.cells);
      if (this.look.slice === null) this.legend = null;
      thing.body.set(
        name,
        values,
        name === "temperature" && this.look.slice === null ? [Math.min(low + 0.02 * (high - low), high - 1e-9), high] : [low, high],
        this.look.slice === null ? hot : undefined,
      );
    }
    if (!thing.arrows) return;
    thing.arrows.object.visible = this.look.arrows && !!columns.velocity;
    if (!thing.arrows.object.visible) return;
    let fastest = thing.ranges.get("arrows");
    if (!fastest) thing.ranges.set("arrows", (fastest = new Range(false)));
    fastest.look(scalars(columns.velocity));
    arrows(thing.arrows, grid, columns.velocity, fastest.high, this.dark || !(this.look.dye && this.look.field === "density") ? 0.95 : 0.1);
  }

  private masses(thing: Thing, columns: Record<string, Column>, frame: Frame): void {
    const x = columns.position?.data;
    if (!x) return;
    const n = x.length / 3;
    const colors = this.shades.of(thing.name);
    const links = thing.topology.links?.data;
    const strain = columns.link_strain?.data;
    const start = this.past(0)?.columns[thing.name]?.link_strain?.data;
    const broken = (piece: number) => !!strain && !!start && Number.isNaN(strain[piece]) && !Number.isNaN(start[piece]);
    const left = (piece: number) => broken(piece) || isLeft(thing, piece, this.look.unseen);
    const torn = new Set<number>();
    if (strain && start && links)
      for (let i = 0; i < strain.length; i++)
        if (broken(i)) torn.add(Math.min(links[2 * i], links[2 * i + 1]) * n + Math.max(links[2 * i], links[2 * i + 1]));
    const ofPiece =
      (pairs: Numbers) =>
      (piece: number): Rgb => {
        const p = 3 * pairs[2 * piece];
        return [colors![p], colors![p + 1], colors![p + 2]];
      };
    if (thing.body instanceof Instances) {
      thing.body.set(columns);
      thing.body.paint(colors);
    } else if (thing.body instanceof Water) {
      thing.body.set(x, columns.triangles.data);
    } else if (isSkin(thing.form)) {
      if (!thing.body) {
        thing.body = new Surface(x, thing.topology.triangles.data, thing.color, {
          flat: thing.form === "body",
        });
        this.add(thing.body);
      }
      const surface = thing.body as Surface;
      surface.set(x, torn, columns.triangles?.data);
      surface.paint(colors);
      surface.tint(colors ? [1, 1, 1] : thing.color);
      surface.object.visible = !this.look.links;
    } else if (isLine(thing.form)) {
      const pairs = along(thing.topology.curve.data, thing.topology.curve_points?.data[0]);
      const gone = (piece: number) =>
        torn.has(Math.min(pairs[2 * piece], pairs[2 * piece + 1]) * n + Math.max(pairs[2 * piece], pairs[2 * piece + 1]));
      (thing.body as Pieces).pairs(x, pairs, colors ? ofPiece(pairs) : thing.color, gone);
      thing.body!.object.visible = !this.look.links || !links;
    } else {
      const r = columns.radius?.data ?? thing.radius;
      const own = columns.color?.data;
      (thing.body as Points).set(x, r, colors ?? own ?? thing.color);
      if (thing.way) {
        thing.way.object.visible = this.look.trails;
        if (this.look.trails) trails(thing.way, thing, frame, this.past, this.night);
      }
    }
    if (thing.links && links) {
      const shown = thing.form === "points" || this.look.links || (this.flat && !isLine(thing.form));
      thing.links.object.visible = shown;
      const shade = thing.color.map((c) => c * (thing.form === "points" ? SHADE : this.look.links ? 1 : DRAWN_ON)) as Rgb;
      if (shown)
        thing.links.pairs(
          x,
          links,
          colors && this.look.color === "strain" && strain ? (piece) => this.shades.link(strain[piece]) : colors ? ofPiece(links) : shade,
          left,
        );
    }
  }

  /** The mass nearest to a point of the window, within some pixels; of bodies the one that is seen there. */
  nearest(
    event: { clientX: number; clientY: number },
    within = 28,
  ): { object: string; row: number; point: THREE.Vector3; mass: number } | null {
    if (!this.frame) return null;
    const box = this.canvas.getBoundingClientRect();
    const mx = event.clientX - box.left;
    const my = event.clientY - box.top;
    const matrix = new THREE.Matrix4().multiplyMatrices(this.camera.projectionMatrix, this.camera.matrixWorldInverse);
    const ray = this.ray(event);
    const p = new THREE.Vector3();
    let best = within ** 2;
    let depth = Infinity;
    let found: { object: string; row: number; point: THREE.Vector3; mass: number } | null = null;
    for (const thing of this.things) {
      // The surface of a liquid is no mass that a hand could hold.
      if (MATTER[thing.form] !== "masses" || thing.body instanceof Water || this.look.hidden.includes(thing.name)) continue;
      const x = this.frame.columns[thing.name]?.position?.data;
      if (!x) continue;
      const masses = thing.topology.mass?.data;
      const hit = thing.body instanceof Instances ? thing.body.hit(ray) : undefined;
      for (let i = 0; i < x.length / 3; i++) {
        p.set(x[3 * i], x[3 * i + 1], x[3 * i + 2]).applyMatrix4(matrix);
        if (p.z > 1) continue;
        const dx = (0.5 + 0.5 * p.x) * box.width - mx;
        const dy = (0.5 - 0.5 * p.y) * box.height - my;
        const d = i === hit ? 0 : dx * dx + dy * dy;
        // Of those about as near, the one in front.
        if (d < best - 25 || (d < best + 25 && d < within ** 2 && p.z < depth)) {
          best = Math.min(best, d);
          depth = p.z;
          found = {
            object: thing.name,
            row: i,
            point: new THREE.Vector3(x[3 * i], x[3 * i + 1], x[3 * i + 2]),
            mass: masses ? masses[Math.min(i, masses.length - 1)] : 1,
          };
        }
      }
    }
    return found;
  }

  /** The point under the pointer in the plane through `through` that faces the camera. */
  under(event: { clientX: number; clientY: number }, through?: THREE.Vector3): THREE.Vector3 | null {
    const normal = this.camera.getWorldDirection(new THREE.Vector3());
    const plane = new THREE.Plane().setFromNormalAndCoplanarPoint(normal, through ?? this.home.target);
    return this.ray(event).ray.intersectPlane(plane, new THREE.Vector3());
  }

  /** From the eye through a point of the window. */
  private ray(event: { clientX: number; clientY: number }): THREE.Raycaster {
    const box = this.canvas.getBoundingClientRect();
    const at = new THREE.Vector2(((event.clientX - box.left) / box.width) * 2 - 1, 1 - ((event.clientY - box.top) / box.height) * 2);
    const ray = new THREE.Raycaster();
    ray.setFromCamera(at, this.camera);
    return ray;
  }

  /** Width of what is seen [m]. */
  get width(): number {
    return this.seen / this.camera.zoom;
  }

  /** Whether the pointer turns the camera now; never where it may not at all. */
  set turning(on: boolean) {
    this.controls.enabled = on && this.turns;
  }

  /** Draws the spring between a mass and the pointer; nothing without an end. */
  spring(from?: THREE.Vector3, to?: THREE.Vector3): void {
    if (from && to) {
      const { start, end, tint } = this.handle.begin(1);
      start.set(from.toArray());
      end.set(to.toArray());
      tint.set([0.9, 0.25, 0.1, 1]);
      this.handle.done(1);
    } else if (this.handle.object.geometry.getAttribute("start")) this.handle.done(0);
    this.touch();
  }

  /** Moves the camera by keys: turns (or moves, in a plane) and zooms. */
  nudge(dx: number, dy: number, zoom: number): void {
    this.follows = false;
    const away = this.camera.position.clone().sub(this.controls.target);
    if (this.camera instanceof THREE.OrthographicCamera) {
      this.camera.zoom *= zoom;
      this.camera.updateProjectionMatrix();
    } else {
      const ball = new THREE.Spherical().setFromVector3(new THREE.Vector3(away.x, away.z, -away.y));
      ball.theta -= dx * 0.1;
      ball.phi = Math.min(Math.max(ball.phi - dy * 0.1, 0.02), Math.PI - 0.02);
      ball.radius /= zoom;
      const turned = new THREE.Vector3().setFromSpherical(ball);
      this.camera.position.copy(this.controls.target).add(new THREE.Vector3(turned.x, -turned.z, turned.y));
      this.controls.update();
    }
    this.touch();
  }

  /** The picture as it is, with its background. */
  async picture(type = "image/png", quality?: number): Promise<Blob> {
    if (this.lost) throw new Error("There is no picture: the browser has taken the graphics away.");
    this.render();
    const flat = document.createElement("canvas");
    flat.width = this.canvas.width;
    flat.height = this.canvas.height;
    this.copy(flat);
    return new Promise((resolve, reject) => flat.toBlob((b) => (b ? resolve(b) : reject(new Error("no picture"))), type, quality));
  }

  /** The current picture on its background, which is not part of the canvas. */
  copy(flat: HTMLCanvasElement): void {
    const context = flat.getContext("2d")!;
    const [top, bottom] = this.background;
    const shade = context.createLinearGradient(0, 0, 0, flat.height);
    shade.addColorStop(0, top);
    shade.addColorStop(1, bottom);
    context.fillStyle = shade;
    context.fillRect(0, 0, flat.width, flat.height);
    context.drawImage(this.canvas, 0, 0, flat.width, flat.height);
  }

  /** Objects drawn as triangles. */
  get surfaces(): { name: string; mesh: THREE.Mesh }[] {
    return this.things.flatMap((t) =>
      t.body instanceof Surface || t.body instanceof Instances ? [{ name: t.name, mesh: t.body.object }] : [],
    );
  }

  get background(): [string, string] {
    if (this.night) return ["#07090f", "#0b0d14"];
    return document.documentElement.dataset.theme === "dark" ? ["#1b2027", "#14181d"] : ["#f6f8fa", "#e3e8ee"];
  }
}
