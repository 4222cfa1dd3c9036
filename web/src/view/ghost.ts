/** How things stood on another way that time went: seen through, in one colour, beside what there is now. */
import * as THREE from "three";
import type { Column, Frame, SceneInfo } from "../engine/protocol";
import { type Layer, Pieces, Points, type Rgb, Surface } from "./layers";
import { massesOf } from "./scenery";

interface Shade {
  name: string;
  topology: Record<string, Column>;
  body: Layer;
  set: (x: Frame["columns"][string]) => void;
}

export class Ghost {
  private readonly group = new THREE.Group();
  private shades: Shade[] = [];
  private info: SceneInfo | null = null;
  private dark = false;

  /** In which scene of three it appears. */
  constructor(scene: THREE.Scene) {
    scene.add(this.group);
  }

  /** Of which world; null ends it. */
  open(info: SceneInfo | null, dark: boolean): void {
    if (info === this.info && dark === this.dark) return;
    this.clear();
    this.info = info;
    this.dark = dark;
    const color: Rgb = dark ? [0.75, 0.82, 0.95] : [0.02, 0.03, 0.06];
    for (const object of info ? massesOf(info) : []) {
      const topology = info!.topology[object.name] ?? {};
      const radius = topology.radius?.data[0] ?? 0.01;
      const shade = this.shade(topology, color, radius);
      this.shades.push({ name: object.name, topology, ...shade });
      shade.body.object.renderOrder = 2;
      this.group.add(shade.body.object);
    }
  }

  private shade(topology: Record<string, Column>, color: Rgb, radius: number): Pick<Shade, "body" | "set"> {
    const triangles = topology.triangles?.data;
    const curve = topology.curve?.data;
    if (triangles?.length) {
      let made: Surface | undefined;
      const body: Layer = { object: new THREE.Group(), dispose: () => made?.dispose() };
      return {
        body,
        set: ({ position }) => {
          if (made) return made.set(position.data);
          made = new Surface(position.data, triangles, color);
          made.veil(0.3);
          body.object.add(made.object);
        },
      };
    }
    if (curve?.length) {
      const pairs = new Uint32Array(2 * Math.max(curve.length - 1, 0));
      for (let i = 0; i + 1 < curve.length; i++) pairs.set([curve[i], curve[i + 1]], 2 * i);
      const body = new Pieces(radius, { thinnest: 1.5, lit: false });
      body.veil(0.4);
      return { body, set: ({ position }) => body.pairs(position.data, pairs, color) };
    }
    const body = new Points(false, 2, true);
    return { body, set: (columns) => body.set(columns.position.data, columns.radius?.data ?? radius, color) };
  }

  /** Shows a frame of that world; nothing without one. */
  show(frame: Frame | undefined): void {
    this.group.visible = !!frame;
    for (const shade of this.shades) {
      const columns = frame?.columns[shade.name];
      shade.body.object.visible = !!columns?.position;
      if (columns?.position) shade.set(columns);
    }
  }

  private clear(): void {
    for (const { body } of this.shades) {
      this.group.remove(body.object);
      body.dispose();
    }
    this.shades = [];
  }

  dispose(): void {
    this.clear();
    this.group.removeFromParent();
  }
}
