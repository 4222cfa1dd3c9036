/**
 * Messages between page and worker. The page asks with an id, the worker answers each request once, with the same id.
 * Worlds are numbered by the page, so that one worker runs several side by side (integrator lab, time branches).
 */

import type { Form } from "./looks";
import type { Ledger, ObjectKind, StepReport } from "./measures";

export type { Form, Ledger, ObjectKind, StepReport };

/** Numbers of a column, transferred: the page owns them. */
export type Numbers = Float32Array | Float64Array | Uint32Array;

/** A column of an object. Rows are `width` numbers each; a column on a grid says its points along each axis, first axis fastest. */
export interface Column {
  data: Numbers;
  width: number;
  /** Points along each axis of the grid; empty for tables. Two in a plane, three in space. */
  points: number[];
  /** SI unit; "1" for a pure number. */
  unit: string;
}

/** object -> column -> numbers */
export type Columns = Record<string, Record<string, Column>>;

export interface ObjectInfo {
  name: string;
  kind: ObjectKind;
  /** Name of the system that moves it; none for colliders. */
  system?: string;
}

/** How an object is drawn. */
export interface Look {
  object: string;
  form: Form;
  /** Where its parts have none of their own; linear light. */
  color: Vector;
  /** Of points and curves [m]. */
  radius: number;
  /** How long points leave a trail behind them [s]. */
  trail: number;
  /** A step farther than this is none [m]. */
  leap: number | null;
  /** A point and the unit normal of a ground, where it is not turned or moved. */
  plane: [Vector, Vector] | null;
  strands: number;
  /** Whether its masses are so few that it is drawn thicker. */
  few: boolean;
}

/** A checked scene, built and standing at frame 0 (or, after a live `set`, at the frame where it stood). */
export interface SceneInfo {
  title: string;
  /** Frames per second, frames of the whole scene, length of a frame [s]. */
  fps: number;
  frames: number;
  dt: number;
  dimension: 2 | 3;
  /** Plane of a scene in two dimensions. */
  plane: "xy" | "xz";
  precision: "single" | "double";
  objects: ObjectInfo[];
  /** Names of the systems and what moves them. */
  systems: { name: string; method: string; integrator: string }[];
  /** Columns that the scene asks for, those of each frame unless others are asked for. */
  columns: string[];
  /** Constant columns: triangles, vertices of the mesh of bodies, links, curve, radius, mass, grid_cells, grid_origin, grid_spacing, grid_flat, mesh of colliders. */
  topology: Columns;
  /** How the objects are drawn, in the order of their columns, and object and row of both ends of each anchor that pulls. */
  looks: { objects: Look[]; anchors: [[string, number], [string, number]][] };
  /** The resolved scene: every default written out. */
  scene: Record<string, unknown>;
  /** Warnings; docs/warnings.md lists the codes. */
  warnings: { code: string; path: string; message: string }[];
  /** State hash, 16 hexadecimal digits, as `tumble` prints it natively. */
  hash: string;
  /** Upper estimate of the memory that it needs [bytes]. */
  memory: number;
}

/** The scene's camera at one time; what is `null`, the page chooses. */
export interface Sight {
  position: Vector | null;
  target: Vector | null;
  /** Horizontal [°]. */
  view_angle: number;
}

export interface Frame {
  index: number;
  time: number;
  columns: Columns;
  /** The scene's camera at this time; `null` if it stands. */
  sight: Sight | null;
  /** The books after each frame of this answer; at least the last. */
  ledgers: Ledger[];
  report: StepReport | null;
  /** Only where asked for. */
  hash?: string;
  /** Milliseconds that the engine computed. */
  ms: number;
  /** Frames that `restore` can go to, rising. */
  kept: number[];
  /** For a view inside the frame after `index`: number of sub-steps, system of the last one, and its length [s]. */
  inside?: { substeps: number; system: string; step: number };
}

/** The pre-flight estimate of one system. A limit of 0: no step is stable; `null`: every one is. */
export interface Stability {
  system: string;
  integrator: string;
  step: number;
  frequency: number;
  damping: number;
  damping_max: number;
  culprit: [string, number] | null;
  limits: { integrator: string; stable: number | null; usable: number | null }[];
}

/** One thing wrong with a scene. */
export interface Issue {
  path: string;
  /** From 1, in the text that was sent. */
  line: number | null;
  message: string;
}

/** A change that was tried after a failed step. */
export interface Cure {
  /** `system.0.step=0.001` */
  set: string;
  survived: boolean;
  energy_ratio: number;
}

/** A mesh file that a scene names, by the path that stands in the scene. */
export type Files = Record<string, Uint8Array>;

export type Vector = [number, number, number];

/** Value of a slider, a field or a file: numbers, words, lists. */
export type Value = number | string | boolean | Value[] | { [key: string]: Value };

interface Asked {
  id: number;
  /** Which world; 0 where left out. */
  world?: number;
}

export type Request = Asked &
  /** Checks and builds a scene. Overrides: "time.fps=30", "sheet.flag.size=[1, 2]". -> loaded */
  (
    | { type: "load"; toml: string; overrides?: string[]; files?: Files }
    /**
     * Steps; answers with the last frame. Stops early, after whole frames, when `budget` [ms] is spent. -> frame
     * Columns where given replace those of the scene.
     */
    | { type: "step"; frames?: number; budget?: number; columns?: string[]; hash?: boolean }
    /** A look at the state after so many sub-steps of the next frame; the world stays where it is. -> frame, or done: it has no more. */
    | { type: "inside"; substeps: number; columns?: string[] }
    /** The frame as it stands, without a step. -> frame */
    | { type: "read"; columns?: string[]; hash?: boolean }
    /** Back to frame 0. -> frame */
    | { type: "reset"; columns?: string[] }
    /** To the kept frame at or before `frame`. -> frame */
    | { type: "restore"; frame: number; columns?: string[] }
    /**
     * Overrides a value of the scene and goes on from where the world stands, with everything that the state does not hold taken from the
     * changed scene. -> changed; where sizes change it starts anew (`live: false`).
     */
    | { type: "set"; path: string; value: Value }
    /** A spring from a mass (row of its object) to a point; again with another target to drag. -> done */
    | { type: "grab"; object: string; row: number; target: Vector }
    | { type: "release" }
    /**
     * Adds to the velocity [m/s] (and density [kg/m³] of smoke, where given) of a gas around a point, falling off as a Gaussian of `radius` [m].
     * -> done
     */
    | { type: "stir"; gas: string; position: Vector; velocity: Vector; radius: number; density?: number }
    /** -> hash */
    | { type: "hash" }
    /** -> stability, of those systems for which it is found within `budget` [ms], or some seconds; takes about as long as some steps */
    | { type: "stability"; budget?: number }
    /** After a failed step. -> cures; takes long */
    | { type: "cures" }
    /** Fetches the engine of a precision before a scene needs it. -> done */
    | { type: "warm"; precision: "single" | "double" }
    /** JSON schema of scenes: docs, defaults, ranges; units are under "x-unit". -> schema */
    | { type: "schema" }
    /** Keeps the way that the world went, as it stands, under a number of the page's: the world may then go another. -> hash */
    | { type: "park"; as: number }
    /**
     * Goes back to a way that was parked, exactly as it stood; `toml`, `overrides` and `files` are those of the world then. The way that
     * the world went instead is parked in its turn where `as` is given. -> changed
     */
    | { type: "take"; from: number; as?: number; toml: string; overrides: string[]; files: Files }
    /** Forgets a way that was parked. -> done */
    | { type: "unpark"; as: number }
    /** Forgets a world. -> done */
    | { type: "drop" }
  );

/** `Omit` for each member of a union. */
type Without<T, K extends PropertyKey> = T extends unknown ? Omit<T, K> : never;

/** A request without its id, as the page writes it. */
export type Question = Without<Request, "id">;

/** Source of a failure: the scene, a step, a limit of the browser, or the engine itself (the worker was started anew). */
export type FailureKind = "scene" | "step" | "limit" | "crash";

export interface Failure {
  kind: FailureKind;
  /** All of it, for people. */
  message: string;
  /** Of a scene: every place, in the order of lines. */
  issues: Issue[];
  /** Line and path of the first issue. */
  line?: number;
  path?: string;
  /** Mesh files that the scene names and that did not come with it. */
  missing?: string[];
}

export type Answer = { id: number } & (
  | { type: "loaded"; info: SceneInfo }
  | { type: "changed"; info: SceneInfo; live: boolean }
  | { type: "frame"; frame: Frame }
  | { type: "hash"; hash: string }
  | { type: "stability"; stability: Stability[] }
  | { type: "cures"; cures: Cure[] }
  | { type: "schema"; schema: Record<string, unknown> }
  | { type: "done" }
  /** The world that stood before keeps running. */
  | { type: "failed"; failure: Failure }
);

/** Without an id: the worker is ready, with its version; or it will never be. */
export type Notice = { type: "ready"; version: string } | { type: "broken"; message: string };
