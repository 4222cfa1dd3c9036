/** How far away the nearest solid thing is in each pixel: smoke is seen as far as that. */
import * as THREE from "three";

/** Uniforms of what is seen through, of the picture that is drawn now. */
export const SOLIDS = { depths: { value: null as THREE.Texture | null }, solid: { value: false } };

type Drawn = THREE.Mesh<THREE.BufferGeometry, THREE.Material>;

export class Depths {
  private target: THREE.WebGLRenderTarget | null = null;
  /** Light and colour would be lost. */
  private readonly plain = new THREE.MeshBasicMaterial({ colorWrite: false, side: THREE.DoubleSide });

  /** Draws the depths of a scene with smoke; nothing where there is none, or nothing that could hide it. */
  draw(renderer: THREE.WebGLRenderer, scene: THREE.Scene, camera: THREE.Camera, size: THREE.Vector2): void {
    SOLIDS.depths.value = null;
    SOLIDS.solid.value = false;
    const solid: Drawn[] = [];
    const other: THREE.Object3D[] = [];
    let smoke = false;
    scene.traverseVisible((object) => {
      const { material } = object as Drawn;
      if (!material) return;
      if ((material as THREE.ShaderMaterial).uniforms?.depths) smoke = true;
      if (material.depthWrite && !(object as THREE.Object3D & { isLine?: boolean }).isLine) solid.push(object as Drawn);
      else other.push(object);
    });
    if (!smoke || !solid.length) return;
    if (!this.target || this.target.width !== size.x || this.target.height !== size.y) {
      this.target?.dispose();
      this.target = new THREE.WebGLRenderTarget(size.x, size.y, {
        format: THREE.RedFormat,
        depthTexture: new THREE.DepthTexture(size.x, size.y, THREE.UnsignedIntType),
      });
    }
    const own = solid.map((mesh) => mesh.material);
    for (const mesh of solid) if ((mesh.material as THREE.MeshStandardMaterial).isMeshStandardMaterial) mesh.material = this.plain;
    for (const object of other) object.visible = false;
    const { autoUpdate } = renderer.shadowMap;
    renderer.shadowMap.autoUpdate = false;
    renderer.setRenderTarget(this.target);
    renderer.render(scene, camera);
    renderer.setRenderTarget(null);
    renderer.shadowMap.autoUpdate = autoUpdate;
    solid.forEach((mesh, i) => (mesh.material = own[i]));
    for (const object of other) object.visible = true;
    SOLIDS.depths.value = this.target.depthTexture;
    SOLIDS.solid.value = true;
  }

  dispose(): void {
    this.target?.dispose();
    this.plain.dispose();
  }
}
