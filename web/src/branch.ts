/** Branches of time: what was changed, and the way that was left for it. */
import type { SceneInfo, Value } from "./engine/protocol";
import type { Way } from "./way";

/** A value that was changed at a frame. Without a path it was the pointer, which no list of values tells. */
export interface Change {
  frame: number;
  path: string;
  from: Value | null;
  to: Value | null;
}

/** Start of a world: overrides of its text, all of its values, and the hash of its first state. */
export interface Start {
  overrides: Map<string, Value>;
  scene: Record<string, unknown>;
  hash: string;
}

/** All that makes a world what it is, but its text. */
export interface Branch {
  /** The engine keeps its state under this number. */
  id: number;
  /** Hash of the state at its last frame. */
  hash: string;
  way: Way;
  info: SceneInfo;
  overrides: Map<string, Value>;
  start: Start;
  history: Change[];
  /** Later changes, each value once, and the frame at which the branches separate. */
  changes: Change[];
  at: number;
}

/** The history of a world that went back to a frame: values stay as they are, and the pointer's work is undone. */
export function back(history: Change[], frame: number): Change[] {
  return history
    .filter((c) => c.path || c.frame <= frame)
    .map((c) => ({ ...c, frame: Math.min(c.frame, frame) }))
    .reduce(gather, []);
}

/** A history with one change more. Of several of one value at one frame the last counts, of the pointer's the first. */
export function gather(history: Change[], change: Change): Change[] {
  if (!change.path && history.some((c) => !c.path)) return history;
  return [...history.filter((c) => c.path !== change.path || c.frame !== change.frame), change];
}

/** All changes, each value once: from its first to its current value. */
export function merged(changes: Change[], change: Change): Change[] {
  const first = changes.find((c) => c.path === change.path);
  return first ? changes.map((c) => (c === first ? { ...c, to: change.to } : c)) : [...changes, change];
}

/** The same, seen from the other way. */
export const turned = (changes: Change[]): Change[] => changes.map((c) => ({ ...c, from: c.to, to: c.from }));
