import type { Family } from "../links";

/** How fields and objects are shown; of all objects together. */
export interface Look {
  /** Column of grids; without it the first of what there is to see. */
  field: string | null;
  /** Dye in the object's colour instead of a map of colours. */
  dye: boolean;
  arrows: boolean;
  cells: boolean;
  /** Axis across which a field in space is cut; null shows smoke. */
  slice: number | null;
  sliceAt: number;
  links: boolean;
  /** Families of links that are not drawn. */
  unseen: Family[];
  /** Objects that are not drawn. */
  hidden: string[];
  color: "object" | "speed" | "strain";
  trails: boolean;
}

export const LOOK: Look = {
  field: null,
  dye: true,
  arrows: false,
  cells: false,
  slice: null,
  sliceAt: 0.5,
  links: false,
  unseen: [],
  hidden: [],
  color: "object",
  trails: true,
};
