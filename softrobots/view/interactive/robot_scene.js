// The robot: rigid shapes, tubes and curves on the frames of a solved pose.
class RobotScene extends Camera {
  constructor(canvas, data) {
    super(canvas, data);
    const { wrinkling, rigid, tube, line } = data.colours;
    this.placed = data.placed.map((one) => ({ ...one, local: new THREE.Matrix4().set(...one.pose) }));
    this.levels = wrinkling.map(([, rgb]) => look(colourOf(rgb)));
    this.solids = data.solids.map((solid) => rigidMesh(solid, solid.colour));
    this.rigid = data.solids.filter((solid) => solid.elastic).map((solid) => rigidMesh(solid, rigid));
    this.tubes = data.tubes.map((one) => {
      const material = one.link === null ? look(colourOf(tube), tube[3]) : this.levels[0];
      return { ...one, drawn: new Tube(one.frames.length, SIDES, material, true) };
    });
    this.curves = data.curves.map((curve) => ({
      ...curve,
      drawn: new Tube(curve.points.length, CURVE_SIDES, look(colourOf(line)), true),
    }));
    const bodies = [...this.tubes, ...this.curves].map(({ drawn }) => drawn.mesh),
      resting = this.rigid.map(({ mesh }) => mesh),
      solids = this.solids.map(({ mesh }) => mesh);
    for (const mesh of [...solids, ...bodies]) mesh.castShadow = true;
    for (const mesh of resting) mesh.renderOrder = 1;
    for (const { drawn } of this.tubes) drawn.mesh.renderOrder = 2;
    this.scene.add(...solids, ...resting, ...bodies);
    this.arrow = new ForceArrow(this.scene, data);
  }

  // Corners that the window has to show.
  points() {
    const points = [this.arrow.end.clone(), this.tip.clone()];
    for (const { mesh } of this.solids) {
      mesh.geometry.computeBoundingBox();
      const { min, max } = mesh.geometry.boundingBox;
      for (let corner = 0; corner < 8; corner++) {
        const at = ["x", "y", "z"].map((axis, bit) => ((corner >> bit) & 1 ? max : min)[axis]);
        points.push(vector(at).applyMatrix4(mesh.matrix));
      }
    }
    for (const { drawn } of this.tubes) {
      const { array } = drawn.geometry.attributes.position;
      for (let at = 0; at < array.length; at += 21) points.push(vector(array.subarray(at, at + 3)));
    }
    return points;
  }

  // Fixes shapes, and frames that the page places itself, which are given where they are at rest, to the solver's frames there.
  attach(frames) {
    for (const { frame, local } of [...this.placed, ...this.solids, ...this.rigid])
      if (frame >= 0) local.premultiply(placed(frames, frame).invert());
  }

  // The solver's frames, and behind them those that the page places itself.
  #whole(frames) {
    const all = new Float64Array(frames.length + 12 * this.placed.length);
    all.set(frames);
    this.placed.forEach(({ frame, local }, number) => {
      const { elements: e } = frame < 0 ? local : placed(frames, frame).multiply(local);
      all.set([e[0], e[4], e[8], e[1], e[5], e[9], e[2], e[6], e[10], e[12], e[13], e[14]], frames.length + 12 * number);
    });
    return all;
  }

  // frames: 12 numbers each, rotation by rows, then position; null for rest: the translucent robot is not shown
  show({ frames: solved, rest, tip, force, levels }) {
    const world = new THREE.Matrix4(),
      frames = this.#whole(solved);
    const place = (list, from) =>
      list.forEach(({ mesh, frame, local, link }) => {
        mesh.matrix.multiplyMatrices(frame < 0 ? world : placed(from, frame), local);
        mesh.matrixWorldNeedsUpdate = true;
        if (link !== null && list === this.solids) mesh.material = this.levels[levels[link]];
      });
    place(this.solids, frames);
    this.rigid.forEach(({ mesh }) => {
      mesh.visible = rest !== null;
    });
    if (rest !== null) place(this.rigid, rest);
    for (const { drawn, frames: numbers, middle, radius, link } of this.tubes) {
      const centres = [],
        across = [],
        up = [];
      for (const number of numbers) {
        const f = frames.subarray(12 * number, 12 * number + 12);
        for (let axis = 0; axis < 3; axis++) {
          across.push(f[3 * axis]);
          up.push(f[3 * axis + 1]);
          centres.push(f[9 + axis] + middle[0] * f[3 * axis] + middle[1] * f[3 * axis + 1]);
        }
      }
      drawn.move(centres, across, up, radius);
      if (link !== null) drawn.mesh.material = this.levels[levels[link]];
    }
    for (const curve of this.curves) this.#curve(curve, frames);
    this.tip.set(...tip);
    this.arrow.show(this.tip, force);
    this.dirty = true;
  }

  // The thread from the tip to the pointer; null: none.
  stretch(pointer) {
    this.arrow.stretch(this.tip, pointer);
    this.dirty = true;
  }

  #curve({ drawn, points, radius }, frames) {
    const places = points.map(([number, x, y]) => {
      const f = frames.subarray(12 * number, 12 * number + 12);
      const away = new THREE.Vector3(x * f[0] + y * f[1], x * f[3] + y * f[4], x * f[6] + y * f[7]);
      return [new THREE.Vector3(f[9], f[10], f[11]).add(away), away];
    });
    const centres = [],
      across = [],
      up = [];
    places.forEach(([point, away], row) => {
      const along = places[Math.min(row + 1, places.length - 1)][0]
        .clone()
        .sub(places[Math.max(row - 1, 0)][0])
        .normalize();
      const y = along.clone().cross(away).normalize(),
        x = y.clone().cross(along);
      centres.push(...point.toArray());
      across.push(...x.toArray());
      up.push(...y.toArray());
    });
    drawn.move(centres, across, up, radius);
  }
}
