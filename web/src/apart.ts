/** How far two ways that a world went are apart. */
import type { Column, Frame, Numbers } from "./engine/protocol";
import { scalars } from "./view/layers";
import { matched, shownOf } from "./view/scenery";

/** Of two frames, a number; null where they cannot be compared. */
export type Measure = (a: Frame, b: Frame) => number | null;

/** Root of the mean square of the lengths between the same masses of these objects [m]. */
export function ofPositions(objects: string[]): Measure {
  return (a, b) => {
    let sum = 0;
    let count = 0;
    for (const name of objects) {
      const [own, other] = [a.columns[name] ?? {}, b.columns[name] ?? {}];
      const [x, y] = [own.position?.data, other.position?.data];
      // Rows are the same masses where they have the same ids, or where there are as many.
      if (!x || !y || (!(own.id && other.id) && x.length !== y.length)) continue;
      for (const [i, j] of matched(own.id?.data, other.id?.data, x.length / 3, y.length / 3)) {
        let square = 0;
        for (let d = 0; d < 3; d++) square += (x[3 * i + d] - y[3 * j + d]) ** 2;
        if (!Number.isFinite(square)) continue;
        sum += square;
        count++;
      }
    }
    return count ? Math.sqrt(sum / count) : null;
  };
}

/** Values of a grid that are shown, and their unit. */
function shown(columns: Record<string, Column>, field: string): { values: Numbers; column: Column } | null {
  const column = columns[field] ?? (field === "speed" ? columns.velocity : undefined);
  return column ? { values: scalars(column), column } : null;
}

/** Root of the mean square of the differences of a field, over all cells, in its unit. */
export function ofField(field: string): Measure {
  return (a, b) => {
    let sum = 0;
    let count = 0;
    for (const [name, columns] of Object.entries(a.columns)) {
      const [p, q] = [shown(columns, field)?.values, shown(b.columns[name] ?? {}, field)?.values];
      if (!p || !q || p.length !== q.length) continue;
      for (let i = 0; i < p.length; i++) {
        const square = (p[i] - q[i]) ** 2;
        // Holes are no numbers.
        if (!Number.isFinite(square)) continue;
        sum += square;
        count++;
      }
    }
    return count ? Math.sqrt(sum / count) : null;
  };
}

/** The field of a frame's grids that is shown where `chosen` is asked for, and its unit. */
export function fieldOf(frame: Frame, grids: string[], chosen: string | null): { name: string; unit: string } | null {
  for (const grid of grids) {
    const columns = frame.columns[grid] ?? {};
    const name = shownOf(columns, chosen);
    const found = name && shown(columns, name);
    if (name && found) return { name, unit: found.column.unit };
  }
  return null;
}

/** A frame whose grids hold what it has more than another one. */
export function difference(a: Frame, b: Frame, field: string): Frame {
  const columns: Frame["columns"] = {};
  for (const [name, own] of Object.entries(a.columns)) {
    const [p, q] = [shown(own, field), shown(b.columns[name] ?? {}, field)];
    columns[name] = own;
    if (!p || !q || p.values.length !== q.values.length) continue;
    const data = Float32Array.from(p.values, (v, i) => v - q.values[i]);
    columns[name] = { ...own, difference: { data, width: 1, points: p.column.points, unit: p.column.unit } };
  }
  return { ...a, columns };
}
