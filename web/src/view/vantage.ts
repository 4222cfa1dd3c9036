// Where the camera of a scene stands when its scene does not say, and where the light comes from.
import * as THREE from "three";

const UP = new THREE.Vector3(0, 0, 1);

/** Where a box of this size around a target is seen whole: `tan` of half the angle of view, `shape` is the width of the picture over its height. */
export function fitting(target: THREE.Vector3, size: THREE.Vector3, tan: number, shape: number): THREE.Vector3 {
  const from = new THREE.Vector3(0.42, -1, 0.4).normalize();
  const distance = (1.12 * Math.max(size.x * 0.55 + size.y * 0.25, (size.z * 0.55 + size.y * 0.2) * shape)) / tan + 0.35 * size.y;
  return target.clone().addScaledVector(from, Math.max(distance, 1e-6));
}

/** The way to the light, in spans of what is seen, of a camera so far away from its target: from above, and from its left. */
export function lit(away: THREE.Vector3): THREE.Vector3 {
  const left = new THREE.Vector3().crossVectors(UP, away).normalize().negate();
  return left.multiplyScalar(1.1).addScaledVector(UP, 1.7).addScaledVector(away.clone().normalize(), 0.45);
}
