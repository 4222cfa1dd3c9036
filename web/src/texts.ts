/** What the panel says about a value: in words for people, where those of the schema are for those who write scenes. */

/** Names that are no words. */
const LABELS: Record<string, string> = {
  substeps: "Sub-steps",
  fps: "Frames per second",
  gm: "Strength (G M)",
  toomre: "Toomre's Q",
  young: "Young's modulus",
  poisson: "Poisson's ratio",
  jitter: "Irregularity",
  cone: "Opening of the cone",
  rest_length: "Length at rest",
  break_strain: "Strain at which it breaks",
  tethers: "Long-range attachments",
  position_based: "Position-based dynamics",
  fluid_density: "Density of the fluid",
};

/** By owner (a table, or the kind of a force or field) and key, or by key alone where it means the same everywhere. */
export const TEXTS: Record<string, string> = {
  method: "What moves the objects of this system.",
  "pressure.method": "How the pressure is solved.",
  integrator: "How the system steps through time.",
  substeps: "Steps between two exchanges with the rest of the scene. More are more accurate, and slower.",
  step: "Longest step in time. Shorter ones are more accurate, and slower.",
  clamp: "Longer springs are shortened to this multiple of their length at rest.",
  exchanges: "How often in a frame the systems tell each other what they do.",
  "time.fps": "Frames for each second of the scene's time.",
  "time.frames": "Length of the scene, in frames.",
  seed: "Another number gives other random values.",
  modulus: "How hard it is to stretch: the force at which the length would double, per width of a sheet or cross-section of a block.",
  damping: "How fast oscillations die out inside the material.",
  "spring.damping": "Force along the spring for each metre per second at which it becomes longer.",
  "anchor.damping": "Force for each metre per second between its ends.",
  "anchor.stiffness": "Force for each metre that the anchor is stretched.",
  "links.break_strain": "A link breaks when it is longer by this part of its length.",
  "spring.stiffness": "Force for each metre that the spring is stretched.",
  "spring.hardening": "How much stiffer the spring becomes as it is stretched.",
  "spring.break_strain": "The spring breaks when it is longer by this part of its length at rest.",
  "spring.rest_length": "Length at which the spring pulls and pushes nothing.",
  structural: "How hard it is to stretch.",
  shear: "How hard it is to pull askew.",
  bend: "How hard it is to fold.",
  pin: "Masses that are held fixed.",
  "source.density": "Density of the smoke that comes out of it.",
  "source.temperature": "Temperature inside of it.",
  "source.fuel_density": "Density of the fuel that comes out of it.",
  "source.velocity": "Velocity of what comes out of it.",
  "box.size": "Lengths of its sides.",
  diagonals: "One diagonal in each cell of the lattice, or both.",
  "drag.rate": "How fast motion dies away in still air: after one over this time, about a third is left.",
  "drag.quadratic": "Drag that grows with the square of the speed.",
  "drag.coefficient": "Drag of each mass for each metre per second.",
  "wind.rate": "How fast a mass takes on the velocity of the air.",
  "wind.quadratic": "Pull of the air that grows with the square of its speed past a mass.",
  "wind.coefficient": "Pull of the air on each mass for each metre per second of its speed past it.",
  "gravitation.constant": "Newton's constant of gravitation, in the units of this scene.",
  "gravitation.softening": "Distance within which attraction no longer grows.",
  "attraction.gm": "Strength of the pull towards the centre.",
  "lennard_jones.epsilon": "Energy that parts two neighbours.",
  "lennard_jones.sigma": "Diameter of a particle: nearer ones repel each other.",
  "lennard_jones.cutoff": "Particles farther apart than this do not feel each other.",
  "viscosity.coefficient": "Friction between neighbours for each metre per second between them.",
  "viscosity.radius": "Distance at which neighbours feel each other.",
  "viscosity.central": "Friction only along the line between two particles, which keeps the angular momentum.",
  "magnetic.field": "Magnetic field.",
  "electric.field": "Electric field.",
  "flock.nearest": "How many neighbours a bird heeds. Starlings heed seven.",
  "flock.separation": "How hard a bird turns away from one that is too near.",
  "flock.fear": "How hard a bird turns away from a predator.",
  "flock.view": "Angle that a bird sees; behind it, it is blind.",
  "flock.speed": "Speed at which a bird likes to fly.",
  "emitter.speed": "Speed at birth, along the direction.",
  "emitter.speed_spread": "How much the speeds differ: 0 not at all, 1 from standing still to twice as fast.",
  "emitter.lifetime_spread": "How much the lifetimes differ: 0 not at all, 1 from nothing to twice as long.",
  "emitter.mass_spread": "How much the masses differ: 0 not at all, 1 from nothing to twice as heavy.",
  "emitter.radius_spread": "How much the sizes differ: 0 not at all, 1 from nothing to twice as large.",
  "emitter.rate": "Particles born in a second.",
  "emitter.cone": "How far directions at birth may turn away from the middle: 0 is a jet, 180 is everywhere.",
  "emitter.jitter": "0 is like clockwork; 1 is at random.",
  "emitter.inherit": "Part of its parent's or its moving source's velocity that a particle takes along.",
  "emitter.most": "No more particles than this live at once.",
  "burst.count": "Particles born at once.",
  "burst.time": "When they are born.",
  "cloud.count": "Number of masses.",
  "cloud.speed": "Speed at the start, in random directions.",
  trail: "How long the trail behind each particle lasts.",
  "gas.courant": "Cells that the fastest fluid may cross in a step.",
  "gas.viscosity": "How thick the fluid is.",
  "gas.confinement": "Keeps small eddies alive that the grid would smooth away.",
  "gas.acceleration": "Push on all of the fluid.",
  "gas.velocity": "Velocity of the fluid at the start.",
  "smoke.weight": "How much its own weight pulls the smoke down; 0 lets it float.",
  "smoke.initial": "Smoke at the start, a number or a formula of x, y and z.",
  "smoke.dissipation": "How fast the smoke fades.",
  "temperature.ambient": "Temperature at which the fluid neither rises nor sinks.",
  "temperature.cooling": "How fast the fluid cools down to its surroundings.",
  "temperature.radiation": "How fast the fluid cools by glowing, at 1000 K above its surroundings.",
  "temperature.expansion": "How much lighter the fluid becomes with each kelvin.",
  "fire.burn_time": "Time in which two thirds of the fuel burn.",
  "fire.heat": "Heat set free by each kilogram of fuel.",
  "fire.expansion": "Room that each kilogram of burnt fuel takes.",
  initial_density: "Density at the start, a number or a formula of x, y and z.",
  "heat.conductivity": "How well heat flows through the material.",
  "heat.heat_capacity": "Heat that warms a kilogram by one kelvin.",
  "heat.temperature": "Temperature at the start, a number or a formula of x, y and z.",
  "pressure.tolerance": "How much the fluid may still expand or shrink where it should not; smaller is more exact, and slower.",
  "pressure.iterations": "The solver gives up after so many.",
  "self_contact.thickness": "Distance at which two layers touch.",
  "rigid.iterations": "Passes over all contacts in a sub-step. High piles need more; more sub-steps help most.",
  "grains.scheme": "Forces of springs, or hard grains that are moved apart: faster, and less exact.",
  "grains.law": "How the force follows from the overlap.",
  "position_based.iterations": "Sweeps over all elements in a sub-step. More sub-steps help more than more sweeps.",
  "position_based.tethers": "Nothing hangs farther below its pins than this multiple of the way along the cloth.",
  "position_based.stiffness": "Part of an element's error that is put right in a sub-step.",
  "collider.thickness": "Distance kept from the surface.",
  "collider.friction": "0 is ice; rubber on a road has about 1.",
  "body.friction": "0 is ice; rubber on a road has about 1. The rougher of two surfaces counts.",
  "self_contact.friction": "0 is ice; cloth on cloth has about 0.3.",
  restitution: "0 does not bounce; 1 bounces back as fast as it came.",
  friction_static: "Friction while at rest, which must be overcome before it slides.",
  gravity: "Where things fall, and how fast; z points up.",
  rotate: "Turn about x, then y, then z.",
  resolution: "How finely it is divided.",
  "cloth.resolution": "Length of an edge of its triangles.",
  "cloth.density": "Weight of a square metre; cotton has 0.15.",
  "sheet.density": "Weight of a square metre; cotton has 0.15.",
  "net.density": "Weight of a square metre; cotton has 0.15.",
  "rope.density": "Weight of a metre.",
  "block.density": "Weight of a cubic metre; water has 1000.",
  "body.density": "Weight of a cubic metre; water has 1000.",
  "body.mass": "Weight of each body.",
  "body.inertia": "How hard it is to turn about x, y and z of its shape.",
  hinge: "How hard the cloth is to fold.",
  isometric: "How hard a sheet that does not stretch is to bend.",
  area: "How hard a triangle is to make larger or smaller.",
  "tear.strain": "An edge tears when it is longer by this part of its length.",
  "tear.spread": "How much the strength differs from edge to edge.",
  "weak.strain": "Strain at which edges tear here.",
  "material.young": "How stiff the material is: rubber has 1e6, steel 2e11.",
  "material.poisson": "How much it gets thinner when it is stretched: cork 0, rubber nearly 0.5.",
  "rod.stretch": "How hard the rod is to stretch.",
  "rod.shear": "How hard the rod is to shear.",
  "rod.twist": "How hard the rod is to twist.",
  "rod.bend": "How hard the rod is to bend.",
  "hair.damping": "How fast oscillations of the hair die out.",
  "collisions.pressure": "How hard dense hair pushes itself apart.",
  "collisions.friction": "How fast strands take on the velocity of those around them.",
  "galaxy.toomre": "Below 1 the disk falls into clumps; above, it stays smooth.",
  "galaxy.thickness": "Height of the disk, as a part of its length.",
  "vicsek.noise": "How far a particle may stray from the direction of its neighbours.",
  "turbulence.rate": "How fast the swirls change.",
  "turbulence.strength": "How fast the air moves in the swirls.",
  "turbulence.octaves": "Kinds of swirls, each half as large as the one before.",
  "sheet.resistance": "How hard it is for the fluid to pass: a net has 1, a dense fabric 100.",
};

const owned = (owner: string, key: string, from: Record<string, string>): string | undefined => from[`${owner}.${key}`] ?? from[key];

export const label = (key: string): string => LABELS[key] ?? capital(plain(key));

const NAMES = /\b(euler|heun|verlet|prince|gauss|seidel|jacobi)\b/g;

/** A word of a scene, as people write it. */
export const word = (value: string): string =>
  plain(value)
    .replace(NAMES, capital)
    .replace(/^(rk4|bdf2)$/, (s) => s.toUpperCase());

/** Units of links by what they link; the schema has one text for all. */
const LINKED: Record<string, [string, string]> = {
  rope: ["N", "N s"],
  sheet: ["N/m", "N s/m"],
  net: ["N/m", "N s/m"],
  cloth: ["N/m", "N s/m"],
  block: ["Pa", "Pa s"],
};

export function unitOf(path: string, unit: string): string {
  const own = LINKED[path.split(".")[0]];
  if (unit === "N, N/m or Pa") return own?.[0] ?? unit;
  return unit === "modulus x s" ? (own?.[1] ?? unit) : unit;
}

const plain = (key: string): string => key.replace(/_/g, " ");
const capital = (text: string): string => text.charAt(0).toUpperCase() + text.slice(1);

/** Sentences for those who write scenes: other keys, defaults, what goes with what. */
const WRITERS =
  /^(Default|Alternative(ly)?|Without|Not (with|for|a)|Only|Instead|Overrides|It (replaces|also)|Settings of|Parameters of|Names? of|Index)\b|[[\]{}=^|]|\b(column|sqrt|plain only)\b|\b[a-z]+_[a-z_]+\b|"/;

/** The text about a value; empty where its name says it all. */
export function told(owner: string, key: string, description: string): string {
  const own = owned(owner, key, TEXTS);
  if (own !== undefined) return own;
  const sentences = description
    .replace(/\s+/g, " ")
    .split(/(?<=[.;])\s+/)
    .map((s) => s.replace(/`([^`]*)`/g, (_, word: string) => plain(word)).replace(/[;.]$/, ""))
    .filter((s) => s && !WRITERS.test(s));
  const first = sentences[0] ?? "";
  const words = (text: string) =>
    text
      .toLowerCase()
      .replace(/\b(its|the|of|a|an)\b/g, "")
      .trim();
  if (!first || first.length > 140 || words(first) === plain(key) || words(first).split(/\s+/).length < 2) return "";
  return `${capital(first)}.`;
}

/** The text about a choice. */
const CHOICES: Record<string, string> = {
  dynamics: "Masses under forces, stepped by an integrator.",
  position_based: "Positions are guessed, then corrected until springs and contacts are satisfied. Robust; it damps.",
  tracers: "Particles without mass that go along with a flow.",
  vicsek: "Particles that take the direction of their neighbours.",
  grains: "Balls that touch, slide and roll: sand, gravel, beads.",
  hertz: "As elastic balls press on each other.",
  linear: "A spring: bounces take the same time at any speed.",
  rigid: "Bodies that keep their shape: they tumble, collide, slide and pile up.",
  heat: "Heat in solid bodies, on a grid.",
  gas: "A fluid that does not change its volume, on a grid.",
  liquid: "Water with a surface: particles carry it, a grid finds its pressure.",
  pic: "Particles take the velocity of the grid: smooth, and damps strongly.",
  flip: "Particles add what the grid has changed: lively and noisy.",
  affine_flip: "FLIP with the gradient of APIC: keeps more energy than either, and as much noise as FLIP.",
  apic: "Particles take the velocity of the grid and its gradient: smooth, and what turns goes on turning.",
  forward_euler: "The simplest. It gains energy, and explodes where springs are stiff.",
  symplectic_euler: "As cheap as forward Euler; its energy stays near the right one.",
  modified_euler: "Gains energy half as fast as forward Euler.",
  midpoint: "Two looks at the forces in a step; second order.",
  heun: "Two looks at the forces in a step; second order.",
  rk4: "Four looks at the forces in a step; fourth order.",
  adaptive_euler: "Forward Euler that chooses its steps.",
  dormand_prince: "Fifth order; chooses its steps by the error it finds.",
  verlet: "Remembers the position before. Second order; its energy stays near the right one.",
  velocity_verlet: "Second order; its energy stays near the right one.",
  implicit_euler: "Stable at every step; it damps.",
  implicit_midpoint: "Stable at every step; it hardly damps.",
  bdf2: "Remembers the step before. Second order; it damps what is fast.",
};

export const chosen = (value: string, description: string): string => CHOICES[value] ?? told("", value, description);
