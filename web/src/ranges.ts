/** Ranges of sliders: what the schema allows, what a quantity usually has, what is stable. */

export interface Range {
  low: number;
  high: number;
  /** By factors instead of by differences; `low` is then above zero. */
  log: boolean;
}

interface Limits {
  minimum?: number;
  maximum?: number;
  exclusiveMinimum?: number;
  exclusiveMaximum?: number;
}

/** Usual values of quantities that run through powers of ten, by unit. */
const BY_UNIT: Record<string, [number, number]> = {
  "kg/m": [1e-3, 10],
  "kg/m²": [0.01, 10],
  "kg/m³": [0.1, 2e4],
  "N/m": [1, 1e5],
  "N, N/m or Pa": [1, 1e5],
  "modulus x s": [1e-3, 100],
  N: [1, 1e5],
  Pa: [1e3, 1e10],
  "N m": [1e-7, 0.1],
  "N m²": [1e-6, 10],
  "N s/m": [1e-4, 10],
  "Pa s": [1e-6, 1],
  "W/(m K)": [0.02, 500],
  "W/(m² K)": [1, 1e4],
  "J/(kg K)": [100, 1e4],
};

/** Usual values, by key, where neither unit nor schema has a bound. */
const BY_KEY: Record<string, [number, number]> = {
  friction: [0, 1.5],
  friction_static: [0, 1.5],
  clamp: [1, 2],
  tethers: [1, 1.5],
  weight: [0, 2],
  inherit: [0, 1],
  confinement: [0, 2],
  courant: [0.5, 10],
  toomre: [0.5, 3],
  fps: [10, 120],
  noise: [0, 2 * Math.PI],
};

/** The next of 1, 2, 5, 10, 20 … that is no smaller. */
export function round(value: number): number {
  const power = 10 ** Math.floor(Math.log10(value));
  return power * ([1, 2, 5].find((k) => k * power >= value * (1 - 1e-9)) ?? 10);
}

/** Of sub-steps: from one to four times as many as are stable. */
export const ofSteps = (stable: number): [number, number] => [1, round(4 * Math.max(stable, 2))];

/**
 * The range of a value that the scene was opened with. `known` is one that the page has found, as of stable steps; a value outside of what is
 * usual widens it.
 */
export function range(value: number, key: string, unit: string, limits: Limits, whole: boolean, known?: [number, number]): Range {
  const least = limits.minimum ?? limits.exclusiveMinimum ?? -Infinity;
  const most = limits.maximum ?? limits.exclusiveMaximum ?? Infinity;
  const size = Math.abs(value);
  let log = false;
  let low: number;
  let high: number;
  if (known) [low, high] = known;
  else if (BY_KEY[key]) [low, high] = BY_KEY[key];
  else if (BY_UNIT[unit] && value > 0) [low, high] = BY_UNIT[unit];
  // A bound that is far beyond what anyone means is none.
  else if (Number.isFinite(least) && most <= Math.max(1000, 20 * size)) [low, high] = [least, most];
  else if (unit === "°") [low, high] = value > 180 ? [0, 360] : [Math.max(least, -180), 180];
  else {
    const top = round(2 * (size || 0.5));
    [low, high] = [least === -Infinity ? (value > 0 ? 0 : -top) : least, whole ? Math.max(top, 4) : top];
  }
  if (value < low) low = value < 0 ? -round(-value) : value > 0 && low > 0 ? 1 / round(1 / value) : Math.min(value, 0);
  if (value > high) high = round(value);
  [low, high] = [Math.max(low, least), Math.min(high, most)];
  if (low > 0 && high / low > 50 && unit !== "°") log = true;
  return { low, high, log };
}
