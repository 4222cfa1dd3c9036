/** Files that a person brings: scenes, and meshes. */
import { stringify } from "smol-toml";
import { dropped } from "./session";

/** Larger ones are refused [bytes]. */
const LARGEST = { scene: 1_000_000, mesh: 64 * 2 ** 20 };

/** Scenes that were opened from files, by their number in the address. */
export const opened: { name: string; toml: string }[] = [];

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

/** Opens a scene; meshes are kept for scenes that name them. A mesh alone gets a sheet that falls on it. */
export async function acceptFiles(files: File[]): Promise<void> {
  let scene: { name: string; toml: string } | null = null;
  let mesh: string | null = null;
  for (const file of files) {
    if (/\.toml$/i.test(file.name)) {
      if (file.size > LARGEST.scene) throw new Error(`${file.name} is larger than a scene may be (1 MB)`);
      scene = { name: file.name, toml: await file.text() };
    } else if (/\.json$/i.test(file.name)) {
      if (file.size > LARGEST.scene) throw new Error(`${file.name} is larger than a scene may be (1 MB)`);
      scene = { name: file.name, toml: stringify(JSON.parse(await file.text()) as Record<string, unknown>) };
    } else if (/\.(ply|obj|stl|glb)$/i.test(file.name)) {
      if (file.size > LARGEST.mesh) throw new Error(`${file.name} is larger than a mesh may be (64 MiB)`);
      dropped[file.name] = new Uint8Array(await file.arrayBuffer());
      mesh = file.name;
    } else throw new Error(`${file.name} is neither a scene (.toml, .json) nor a mesh (.ply, .obj, .stl, .glb)`);
  }
  if (!scene && mesh) scene = { name: mesh, toml: FALLING(mesh) };
  if (!scene) return;
  opened.push(scene);
  location.hash = `#/scene/file/${opened.length}`;
}
