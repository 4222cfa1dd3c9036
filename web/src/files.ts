/** Files that a person brings: scenes, and meshes. */
import { stringify } from "smol-toml";
import { say } from "./dom";
import type { Files } from "./engine/protocol";
import { asked } from "./engine/worth";
import { dropped } from "./session";
import { fromFile, type Shared } from "./share";

/** Larger ones are refused [bytes]. */
const LARGEST = { scene: 1_000_000, mesh: 64 * 2 ** 20, shared: 64 * 2 ** 20 };

/** Scenes that were opened from files, by their number in the address. */
export const opened: { name: string; toml: string; files: Files; shared?: Shared }[] = [];

const FALLING = (path: string) => `version = 1
title = "A sheet falls on ${path.replace(/["\\\\\u0000-\u001f]/g, "")}"

[time]
frames = 96

[[system]]
integrator = "implicit_euler"
substeps = 6

[[sheet]]
name = "sheet"
size = [1.5, 1.5]
resolution = [49, 49]
center = [0, 0, 1.2]
links = { structural = { modulus = 600.0, damping = 0.4 }, shear = { modulus = 150.0, damping = 0.1 }, bend = { modulus = 3.0, damping = 0.02 } }

# Scale and move the mesh until it fits.
[[collider]]
name = "mesh"
shape = { mesh = { path = ${JSON.stringify(path)}, scale = 1.0, translate = [0, 0, 0] } }
thickness = 0.012
friction = 0.4

[[collider]]
name = "floor"
shape = { floor = {} }
thickness = 0.01
friction = 0.5
`;

/** JSON as TOML, which the editor shows; the engine tells where a damaged one is wrong. */
function written(json: string): string {
  try {
    return stringify(JSON.parse(json) as Record<string, unknown>);
  } catch {
    return json;
  }
}

/** Meshes that the scene of the page misses, and what is done when they are there. */
let wanted: { paths: string[]; then: () => void } | null = null;

export function want(paths: string[], then: () => void = () => {}): void {
  wanted = paths.length ? { paths, then } : null;
}

/** Opens a scene; meshes are kept for scenes that name them. A mesh alone gets a sheet that falls on it. */
export async function acceptFiles(files: File[]): Promise<void> {
  let scene: (typeof opened)[number] | null = null;
  let mesh: string | null = null;
  for (const file of files) {
    if (/\.toml$/i.test(file.name)) {
      if (file.size > LARGEST.scene) throw new Error(`${file.name} is larger than a scene may be (1 MB)`);
      scene = { name: file.name, toml: await file.text(), files: {} };
    } else if (/\.json$/i.test(file.name)) {
      if (file.size > LARGEST.scene) throw new Error(`${file.name} is larger than a scene may be (1 MB)`);
      scene = { name: file.name, toml: written(await file.text()), files: {} };
    } else if (/\.(ply|obj|stl|glb)$/i.test(file.name)) {
      if (file.size > LARGEST.mesh) throw new Error(`${file.name} is larger than a mesh may be (64 MiB)`);
      dropped[file.name] = new Uint8Array(await file.arrayBuffer());
      mesh = file.name;
    } else if (/\.tumble$/i.test(file.name)) {
      if (file.size > LARGEST.shared) throw new Error(`${file.name} is larger than a shared scene may be (64 MiB)`);
      const { shared, meshes } = await fromFile(new Uint8Array(await file.arrayBuffer())).catch((error) => {
        throw new Error(`${file.name} is damaged: ${error.message}`);
      });
      scene = { name: file.name, toml: shared.text, files: meshes, shared };
    } else throw new Error(`${file.name} is neither a scene (.toml, .json, .tumble) nor a mesh (.ply, .obj, .stl, .glb)`);
  }
  if (!scene && wanted) {
    const there = asked(wanted.paths, dropped).size;
    if (there === wanted.paths.length) return wanted.then();
    if (there) return say(`${wanted.paths.length - there} more are missing.`);
  }
  if (!scene && mesh) scene = { name: mesh, toml: FALLING(mesh), files: {} };
  if (!scene) return;
  opened.push(scene);
  location.hash = `#/scene/file/${opened.length}`;
}
