/** How things stood on another way that time went: seen through, in one colour, beside what there is now. */
import * as THREE from "three";
import { MATTER } from "../engine/looks";
import type { Column, Frame, Look, SceneInfo } from "../engine/protocol";
import { Instances } from "./instances";
import { type Layer, Pieces, Points, type Rgb, Surface } from "./layers";
import { along } from "./scenery";

interface Shade {
  name: string;
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
    for (const look of info?.looks.objects ?? []) {
      if (MATTER[look.form] !== "masses") continue;
      const shade = this.shade(info!.topology[look.object] ?? {}, look, color);
      this.shades.push({ name: look.object, ...shade });
      shade.body.object.renderOrder = 2;
      this.group.add(shade.body.object);
    }
  }

  private shade(topology: Record<string, Column>, { form, radius }: Look, color: Rgb): Pick<Shade, "body" | "set"> {
    if (form === "surface" || form === "body") {
      const triangles = topology.triangles.data;
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
    if (form === "instances") {
      const body = new Instances(topology, color);
      body.veil(0.3);
      return { body, set: (columns) => body.set(columns) };
    }
    if (form === "curve" || form === "strands") {
      const pairs = along(topology.curve.data, topology.curve_points?.data[0]);
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
