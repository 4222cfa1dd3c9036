/** Bodies that all have one mesh, with sharp edges. */
import * as THREE from "three";
import type { Column } from "../engine/protocol";
import { BEHIND, edged, type Layer, type Rgb, release } from "./layers";

export class Instances implements Layer {
  readonly object: THREE.InstancedMesh<THREE.BufferGeometry, THREE.MeshStandardMaterial | THREE.MeshBasicMaterial>;

  /** What does not change of the bodies; `plain` without light. There is nothing to see before `set`. */
  constructor(
    { vertices, triangles, mass }: Record<string, Column>,
    private readonly color: Rgb,
    plain = false,
  ) {
    const side = THREE.DoubleSide;
    const material = plain
      ? new THREE.MeshBasicMaterial({ side })
      : new THREE.MeshStandardMaterial({ roughness: 0.75, metalness: 0, side });
    const geometry = edged(vertices.data, triangles.data);
    geometry.computeBoundingBox();
    const n = mass.data.length;
    this.object = new THREE.InstancedMesh(geometry, material, n);
    this.object.instanceMatrix.setUsage(THREE.DynamicDrawUsage);
    this.object.instanceColor = new THREE.InstancedBufferAttribute(new Float32Array(3 * n), 3);
    this.object.count = 0;
    this.object.castShadow = this.object.receiveShadow = true;
    this.object.frustumCulled = false;
    this.paint(null);
  }

  /** Where the bodies are and how they are turned. */
  set({ position, turn }: Record<string, Column>): void {
    const [x, q] = [position.data, turn.data];
    const matrix = new THREE.Matrix4();
    const place = new THREE.Vector3();
    const rotation = new THREE.Quaternion();
    const size = new THREE.Vector3(1, 1, 1);
    this.object.count = x.length / 3;
    for (let i = 0; i < this.object.count; i++)
      this.object.setMatrixAt(i, matrix.compose(place.fromArray(x, 3 * i), rotation.fromArray(q, 4 * i), size));
    this.object.instanceMatrix.needsUpdate = true;
    this.object.boundingSphere = null;
  }

  /** Colours of the bodies, three numbers each; without them the colour of the object. */
  paint(colors: Float32Array | null): void {
    const { instanceColor, material } = this.object;
    if (colors) instanceColor!.array.set(colors);
    else instanceColor!.array.fill(1);
    instanceColor!.needsUpdate = true;
    material.color.setRGB(...(colors ? ([1, 1, 1] as Rgb) : this.color), THREE.LinearSRGBColorSpace);
  }

  /** Makes room for the bodies in a box. */
  expand(box: THREE.Box3): void {
    const matrix = new THREE.Matrix4();
    const own = new THREE.Box3();
    for (let i = 0; i < this.object.count; i++) {
      this.object.getMatrixAt(i, matrix);
      if (matrix.elements.every(Number.isFinite)) box.union(own.copy(this.object.geometry.boundingBox!).applyMatrix4(matrix));
    }
  }

  /** The first body that a ray meets. */
  hit(ray: THREE.Raycaster): number | undefined {
    return ray.intersectObject(this.object)[0]?.instanceId;
  }

  /** Lets one see through them, and through to what lies in the same place. */
  veil(opacity: number): void {
    Object.assign(this.object.material, { ...BEHIND, transparent: true, depthWrite: false, opacity });
    this.object.castShadow = this.object.receiveShadow = false;
  }

  dispose(): void {
    release(this.object);
    this.object.dispose();
  }
}
