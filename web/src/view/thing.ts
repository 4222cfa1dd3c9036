/** An object in the picture: how it looks, and the layers that draw it. */
import type * as THREE from "three";
import type { Form } from "../engine/protocol";
import type { Instances } from "./instances";
import type { Grid, Pieces, PlaneField, Points, Range, Rgb, SpaceField, Surface, Water } from "./layers";
import type { Shaded } from "./shades";

export interface Thing extends Shaded {
  form: Form;
  color: Rgb;
  radius: number;
  trail: number;
  leap: number;
  grid: Grid | null;
  body?: Points | Surface | Water | Instances | PlaneField | SpaceField | Pieces;
  links?: Pieces;
  way?: Pieces;
  arrows?: Pieces;
  ranges: Map<string, Range>;
  plane?: THREE.Mesh;
  at?: [THREE.Vector3, THREE.Vector3];
}

export const isLine = (form: Form) => form === "curve" || form === "strands";
export const isSkin = (form: Form) => form === "surface" || form === "body";
export const isSolid = (form: Form) => form === "solid" || form === "container";
