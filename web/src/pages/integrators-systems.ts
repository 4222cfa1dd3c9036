/** The systems of the page of integrators: scenes, exact solutions and limits, and what the lecture shows of them. */

import type { Stability } from "../engine/protocol";

interface System {
  name: string;
  about: string;
  /** Fields carry particles, and have no energy. */
  field: boolean;
  /** Highest angular frequency, where it is known without asking the engine [rad/s]. */
  omega: number;
  steps: [number, number];
  /** How long one looks at it [s]. */
  end: number;
  object: string;
  toml(scheme: string, h: number): string;
  /** Axes of the path or phase: position and velocity of the last mass. */
  phase(x: ArrayLike<number>, v: ArrayLike<number> | undefined): [number, number];
  axes: [string, string];
  /** Exact position of the last mass. */
  exact?(t: number): [number, number, number];
  /** Added to the energy, so that it starts above zero [J]. */
  zero: number;
  theory: { page: string; tags: string[] };
}

const head = (title: string, h: number, method: string, precision = "double") => `version = 1
title = "${title}"
precision = "${precision}"
[time]
fps = ${1 / h}
frames = 1000000
${method}`;
const dynamics = (scheme: string) =>
  `[[system]]\nintegrator = "${scheme}"\n${ADAPTIVE.has(scheme) ? "adaptive = { tolerance = 1e-4 }" : "substeps = 1"}\n`;
const tracers = (scheme: string) => dynamics(scheme).replace("[[system]]", '[[system]]\nmethod = "tracers"');
export const ADAPTIVE = new Set(["adaptive_euler", "dormand_prince"]);
export const W = 2 * Math.PI;

export const SYSTEMS: Record<string, System> = {
  spring: {
    name: "Spring",
    about: "One mass on a spring, one oscillation per second, no damping. Its energy should be constant and its phase plot a circle.",
    field: false,
    omega: W,
    steps: [0.002, 0.5],
    end: 20,
    object: "spring",
    zero: 0,
    axes: ["extension [m]", "v/ω [m]"],
    // A spring without a rest length is linear however far it goes.
    toml: (s, h) =>
      `${head("A mass on a spring", h, dynamics(s))}[world]\ngravity = [0, 0, 0]\n[[particles]]\nname = "spring"\nposition = [[0, 0, 0], [0.5, 0, 0]]\nmass = [1]\nradius = 0.08\npin = ["vertex 0"]\nspring = [{ between = [0, 1], stiffness = ${W * W}, rest_length = 0 }]\n[output]\ncolumns = ["position", "velocity"]\n`,
    phase: (x, v) => [x[3], (v?.[3] ?? 0) / W],
    exact: (t) => [0.5 * Math.cos(W * t), 0, 0],
    theory: { page: "oscillator", tags: ["oscillator.1", "oscillator.2"] },
  },
  rusty: {
    name: "Rusty spring",
    about:
      "The same spring with internal damping: the oscillation and its energy decay. A scheme should lose exactly as much energy as the spring.",
    field: false,
    omega: W,
    steps: [0.002, 0.5],
    end: 12,
    object: "spring",
    zero: 0,
    axes: ["extension [m]", "v/ω [m]"],
    toml: (s, h) =>
      `${head("A rusty spring", h, dynamics(s))}[world]\ngravity = [0, 0, 0]\n[[particles]]\nname = "spring"\nposition = [[0, 0, 0], [1.5, 0, 0]]\nmass = [1]\nradius = 0.08\npin = ["vertex 0"]\nspring = [{ between = [0, 1], stiffness = ${W * W}, rest_length = 1, damping = 0.6 }]\n[output]\ncolumns = ["position", "velocity"]\n`,
    phase: (x, v) => [x[3] - 1, (v?.[3] ?? 0) / W],
    exact: (t) => {
      const d = 0.3;
      const w = Math.sqrt(W * W - d * d);
      return [1 + 0.5 * Math.exp(-d * t) * (Math.cos(w * t) + (d / w) * Math.sin(w * t)), 0, 0];
    },
    theory: { page: "oscillator", tags: ["oscillator.2", "oscillator.3"] },
  },
  pendulum: {
    name: "Pendulum",
    about: "A mass on a stiff thread, released from the side. The thread, not the swing, limits the step.",
    field: false,
    omega: 30,
    steps: [0.001, 0.2],
    end: 20,
    object: "bob",
    zero: 9.8 * 1.1,
    axes: ["x [m]", "z [m]"],
    toml: (s, h) =>
      `${head("A pendulum", h, dynamics(s))}[[particles]]\nname = "bob"\nposition = [[0, 0, 0], [1, 0, 0]]\nmass = [1]\nradius = 0.06\npin = ["vertex 0"]\nspring = [{ between = [0, 1], stiffness = 900, rest_length = 1 }]\n[output]\ncolumns = ["position", "velocity"]\n`,
    phase: (x) => [x[3], x[5]],
    theory: { page: "springs", tags: ["springs.1"] },
  },
  orbit: {
    name: "Orbit",
    about:
      "A planet on an ellipse of eccentricity 0.5, with a period of 2π seconds. It needs short steps near the sun and could take long ones far away.",
    field: false,
    omega: 4,
    steps: [0.005, 0.5],
    end: 63,
    object: "planet",
    zero: 0,
    axes: ["x [m]", "y [m]"],
    toml: (s, h) =>
      `${head("An orbit", h, dynamics(s))}[world]\ngravity = [0, 0, 0]\n[[particles]]\nname = "planet"\nposition = [[0.5, 0, 0]]\nvelocity = [[0, 1.7320508075688772, 0]]\nradius = 0.05\n[[force]]\nkind = "attraction"\ngm = 1\n[output]\ncolumns = ["position", "velocity"]\n`,
    phase: (x) => [x[0], x[1]],
    exact: (t) => {
      let e = t;
      for (let i = 0; i < 30; i++) e -= (e - 0.5 * Math.sin(e) - t) / (1 - 0.5 * Math.cos(e));
      return [Math.cos(e) - 0.5, Math.sqrt(0.75) * Math.sin(e), 0];
    },
    theory: { page: "orbits", tags: ["orbits.1", "orbits.2"] },
  },
  swirl: {
    name: "Swirl",
    about:
      "A particle in a flow that rotates once in 2π seconds. Its path is a circle; forward Euler steps along the tangent and leaves it.",
    field: true,
    omega: 1,
    steps: [0.01, 2.5],
    end: 25,
    object: "walker",
    zero: 0,
    axes: ["x [m]", "y [m]"],
    toml: (s, h) =>
      `${head("A swirl", h, tracers(s))}[[particles]]\nname = "walker"\nposition = [[1, 0, 0]]\nradius = 0.04\n[[field]]\nkind = "swirl"\nrate = 1\n[output]\ncolumns = ["position"]\n`,
    phase: (x) => [x[0], x[1]],
    exact: (t) => [Math.cos(t), Math.sin(t), 0],
    theory: { page: "integrators", tags: ["integrators.1"] },
  },
  sink: {
    name: "Sink",
    about:
      "A particle in a flow towards the centre, which it approaches as exp(−t) and never passes. A step longer than 1 overshoots, one longer than 2 diverges.",
    field: true,
    omega: 1,
    steps: [0.05, 3],
    end: 16,
    object: "drop",
    zero: 0,
    axes: ["x [m]", "y [m]"],
    toml: (s, h) =>
      `${head("A sink", h, tracers(s))}[[particles]]\nname = "drop"\nposition = [[0.8, 0.6, 0]]\nradius = 0.04\n[[field]]\nkind = "sink"\nrate = 1\n[output]\ncolumns = ["position"]\n`,
    phase: (x) => [x[0], x[1]],
    exact: (t) => [0.8 * Math.exp(-t), 0.6 * Math.exp(-t), 0],
    theory: { page: "integrators", tags: ["integrators.1"] },
  },
  sheet: {
    name: "Sheet",
    about: "A square of cloth held at two corners. The stiffest of its many modes limits the step.",
    field: false,
    omega: 60,
    steps: [0.001, 0.1],
    end: 6,
    object: "sheet",
    zero: 0.2 * 9.8 * 0.5,
    axes: ["y [m]", "z [m]"],
    toml: (s, h) =>
      `${head("A sheet", h, dynamics(s), "single")}[[sheet]]\nname = "sheet"\nsize = [1, 1]\nresolution = [11, 11]\ncenter = [0, 0, 0]\nlinks = { structural = 60, shear = 20, bend = 1 }\npin = ["corner 0 0", "corner 1 0"]\n[output]\ncolumns = ["position", "velocity"]\n`,
    phase: (x) => [x[x.length - 2], x[x.length - 1]],
    theory: { page: "springs", tags: ["springs.1", "springs.2"] },
  },
};

/** Those that need no second-order form, for flows. */
export const FOR_FIELDS = new Set(["forward_euler", "midpoint", "heun", "rk4", "adaptive_euler", "dormand_prince"]);

export const LECTURE: [string, { system: string; schemes: string[]; h: number }][] = [
  ["The spring's growing energy", { system: "spring", schemes: ["forward_euler", "modified_euler", "symplectic_euler"], h: 0.02 }],
  ["Implicit damping", { system: "spring", schemes: ["implicit_euler", "bdf2", "implicit_midpoint", "symplectic_euler"], h: 0.05 }],
  ["Beyond the limit", { system: "spring", schemes: ["symplectic_euler", "verlet", "rk4", "implicit_euler"], h: 0.325 }],
  ["The rusty spring", { system: "rusty", schemes: ["forward_euler", "symplectic_euler", "rk4", "implicit_euler"], h: 0.05 }],
  ["Forward Euler's spiral", { system: "swirl", schemes: ["forward_euler", "midpoint", "rk4"], h: 0.2 }],
  ["Overshoot", { system: "sink", schemes: ["forward_euler", "heun", "rk4"], h: 1.1 }],
  ["Adaptive steps", { system: "orbit", schemes: ["adaptive_euler", "dormand_prince", "symplectic_euler", "rk4"], h: 0.1 }],
  ["A sheet that explodes", { system: "sheet", schemes: ["forward_euler", "symplectic_euler", "implicit_euler"], h: 0.0125 }],
];

/** Energy after n steps over that at the start, on an undamped spring with z = ω h, where a formula is exact. */
export const PREDICTED: Record<string, (z: number, n: number) => number> = {
  forward_euler: (z, n) => (1 + z * z) ** n,
  midpoint: (z, n) => (1 + z ** 4 / 4) ** n,
  heun: (z, n) => (1 + z ** 4 / 4) ** n,
  rk4: (z, n) => (1 - z ** 6 / 72 + z ** 8 / 576) ** n,
  implicit_euler: (z, n) => (1 + z * z) ** -n,
  implicit_midpoint: () => 1,
};

/** Limits on the two flows, which are linear: |1 + h λ| and its like. */
export function flowLimits(system: string): Stability["limits"] {
  const stable: Record<string, number> =
    system === "sink" ? { forward_euler: 2, midpoint: 2, heun: 2, rk4: 2.785 } : { forward_euler: 0, midpoint: 0, heun: 0, rk4: 2.828 };
  const usable: Record<string, number> = system === "sink" ? stable : { forward_euler: 0.011, midpoint: 0.353, heun: 0.353, rk4: 2.828 };
  return Object.keys(stable).map((integrator) => ({ integrator, stable: stable[integrator], usable: usable[integrator] }));
}
