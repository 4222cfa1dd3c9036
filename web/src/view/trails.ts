/** Trails of particles. */
import type { Frame } from "../engine/protocol";
import type { Pieces, Rgb } from "./layers";
import { matched } from "./scenery";

interface Swarm {
  name: string;
  color: Rgb;
  /** Length of the trails [s]. */
  trail: number;
  /** A step farther than this is none [m]. */
  leap: number;
}

/** Draws the ways of particles through kept frames, `past`, up to this one. */
export function trails(way: Pieces, swarm: Swarm, frame: Frame, past: (index: number) => Frame | undefined, night: boolean): void {
  const frames: Frame[] = [frame];
  for (let k = frame.index - 1; k >= 0; k--) {
    const before = past(k);
    if (!before || before.time < frame.time - swarm.trail - 1e-9) break;
    frames.push(before);
  }
  let total = 0;
  for (let k = 0; k + 1 < frames.length; k++) total += (frames[k + 1].columns[swarm.name]?.position?.data.length ?? 0) / 3;
  const { start, end, tint } = way.begin(Math.max(total, 1));
  let used = 0;
  const dim = night ? 1 : 0.75;
  for (let k = 0; k + 1 < frames.length; k++) {
    const after = frames[k].columns[swarm.name];
    const before = frames[k + 1].columns[swarm.name];
    if (!after?.position || !before?.position) continue;
    const p = before.position.data;
    const q = after.position.data;
    const shade = after.color?.data;
    const fresh = 1 - (frame.time - frames[k].time) / Math.max(swarm.trail, 1e-9);
    const rows = matched(before.id?.data, after.id?.data, p.length / 3, q.length / 3);
    for (const [i, j] of rows) {
      const dx = q[3 * j] - p[3 * i];
      const dy = q[3 * j + 1] - p[3 * i + 1];
      const dz = q[3 * j + 2] - p[3 * i + 2];
      if (Math.hypot(dx, dy, dz) > swarm.leap) continue;
      for (let d = 0; d < 3; d++) {
        start[3 * used + d] = p[3 * i + d];
        end[3 * used + d] = q[3 * j + d];
        tint[4 * used + d] = dim * (shade ? shade[3 * j + d] : swarm.color[d]);
      }
      tint[4 * used + 3] = 0.15 + 0.75 * Math.max(fresh, 0);
      used++;
    }
  }
  way.done(used);
}
