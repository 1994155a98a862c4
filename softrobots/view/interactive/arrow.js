// The force on the tip: its arrow, the handle that is dragged, and the thread from there to the pointer.
class ForceArrow {
  constructor(scene, { size, fullForce, colours }) {
    Object.assign(this, { size, fullForce });
    const green = new THREE.MeshLambertMaterial({
      color: colours.force,
      emissive: colours.force,
      emissiveIntensity: 0.15,
    });
    const width = 0.009 * size;
    this.group = new THREE.Group();
    this.shaft = new THREE.Mesh(new THREE.CylinderGeometry(width, width, 1, 20), green);
    this.head = new THREE.Mesh(new THREE.ConeGeometry(2.6 * width, 7 * width, 24), green);
    this.group.add(this.shaft, this.head);
    this.handle = new THREE.Mesh(new THREE.SphereGeometry(0.016 * size, 24, 16), green);
    this.thread = new THREE.Line(
      new THREE.BufferGeometry().setFromPoints([new THREE.Vector3(), new THREE.Vector3()]),
      new THREE.LineDashedMaterial({ color: colours.force, dashSize: 0.02 * size, gapSize: 0.014 * size }),
    );
    this.thread.visible = this.thread.frustumCulled = false;
    this.end = new THREE.Vector3();
    scene.add(this.group, this.handle, this.thread);
  }

  get visible() {
    return this.group.visible;
  }

  // tip: where the force [N] acts
  show(tip, force) {
    const newtons = Math.hypot(...force);
    this.handle.position.copy(tip);
    this.end.copy(tip);
    this.group.visible = newtons > 1e-12 * this.fullForce;
    if (!this.visible) return;
    const along = vector(force).divideScalar(newtons),
      length = this.size * (0.05 + 0.3 * Math.min(newtons / this.fullForce, 3)),
      head = 0.063 * this.size;
    this.group.position.copy(tip);
    this.group.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), along);
    this.shaft.scale.y = length;
    this.shaft.position.y = 0.5 * length;
    this.head.position.y = length + 0.5 * head;
    this.end.addScaledVector(along, length + head);
  }

  // pointer: where the thread ends; null: none
  stretch(tip, pointer) {
    this.thread.visible = pointer !== null;
    if (pointer) {
      this.thread.geometry.setFromPoints([tip, pointer]);
      this.thread.computeLineDistances();
    }
  }
}
