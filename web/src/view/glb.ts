/** Surfaces as a file for other programs. */
import * as THREE from "three";
import { GLTFExporter } from "three/examples/jsm/exporters/GLTFExporter.js";

/** Nodes of one mesh: few programs know instances. */
function apart(mesh: THREE.InstancedMesh): THREE.Mesh[] {
  return Array.from({ length: mesh.count }, (_, i) => {
    const body = new THREE.Mesh(mesh.geometry, mesh.material);
    mesh.getMatrixAt(i, body.matrix);
    body.matrix.decompose(body.position, body.quaternion, body.scale);
    return body;
  });
}

/** A GLB file, y up as that format has it. */
export async function glb(surfaces: { name: string; mesh: THREE.Mesh }[]): Promise<Blob> {
  const root = new THREE.Group();
  root.rotation.x = -Math.PI / 2;
  for (const { name, mesh } of surfaces) {
    const bodies = mesh instanceof THREE.InstancedMesh ? apart(mesh) : [mesh.clone()];
    for (const body of bodies) {
      body.name = name;
      root.add(body);
    }
  }
  const data = (await new GLTFExporter().parseAsync(root, { binary: true })) as ArrayBuffer;
  return new Blob([data], { type: "model/gltf-binary" });
}
