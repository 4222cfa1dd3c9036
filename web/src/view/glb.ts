/** Surfaces as a file for other programs. */
import * as THREE from "three";
import { GLTFExporter } from "three/examples/jsm/exporters/GLTFExporter.js";

/** A GLB file, y up as that format has it. */
export async function glb(bodies: { name: string; mesh: THREE.Mesh }[]): Promise<Blob> {
  const root = new THREE.Group();
  root.rotation.x = -Math.PI / 2;
  for (const { name, mesh } of bodies) {
    const copy = mesh.clone();
    copy.name = name;
    root.add(copy);
  }
  const data = (await new GLTFExporter().parseAsync(root, { binary: true })) as ArrayBuffer;
  return new Blob([data], { type: "model/gltf-binary" });
}
