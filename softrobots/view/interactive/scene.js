// The robot in three.js: rigid shapes, tubes and curves on the frames of a solved pose, and the camera.
const { THREE } = MeshCat;
const SIDES = 28,
  CURVE_SIDES = 8;
const vector = (numbers) => new THREE.Vector3(...numbers);
const colourOf = (rgb) => new THREE.Color(...rgb.slice(0, 3));
const HEX = (number) => new THREE.Color(number);

function look(colour, opacity = 1) {
  const clear = opacity < 1;
  return new THREE.MeshPhongMaterial({
    color: colour,
    opacity,
    transparent: clear,
    depthWrite: !clear,
    shininess: 40,
    specular: 0x333333,
  });
}

// A frame of a pose, of which each is 12 numbers: its rotation by rows, then its position.
function placed(frames, number) {
  const [a, b, c, d, e, f, g, h, i, x, y, z] = frames.subarray(12 * number, 12 * number + 12);
  return new THREE.Matrix4().set(a, b, c, x, d, e, f, y, g, h, i, z, 0, 0, 0, 1);
}

// A tube through rings of `sides` corners; `closed` has a cap at each end.
class Tube {
  constructor(rings, sides, material, closed) {
    this.rings = rings;
    this.sides = sides;
    this.closed = closed;
    const corners = rings * sides + (closed ? 2 * sides + 2 : 0);
    this.geometry = new THREE.BufferGeometry();
    for (const name of ["position", "normal"]) {
      this.geometry.setAttribute(
        name,
        new THREE.BufferAttribute(new Float32Array(3 * corners), 3).setUsage(THREE.DynamicDrawUsage),
      );
    }
    this.geometry.setIndex(this.triangles());
    this.mesh = new THREE.Mesh(this.geometry, material);
    this.mesh.frustumCulled = false;
  }

  triangles() {
    const index = [],
      { rings, sides } = this;
    for (let ring = 0; ring + 1 < rings; ring++) {
      for (let side = 0; side < sides; side++) {
        const a = ring * sides + side,
          b = ring * sides + ((side + 1) % sides);
        index.push(a, b, b + sides, a, b + sides, a + sides);
      }
    }
    if (this.closed) {
      for (const end of [0, 1]) {
        const first = rings * sides + end * (sides + 1);
        for (let side = 0; side < sides; side++) {
          const pair = [first + 1 + side, first + 1 + ((side + 1) % sides)];
          index.push(first, ...(end ? pair : pair.reverse()));
        }
      }
    }
    return index;
  }

  // centres: 3 numbers a ring; across and up: the axes of its plane, 3 numbers a ring
  move(centres, across, up, radius) {
    const { rings, sides } = this,
      place = this.geometry.attributes.position.array,
      normal = this.geometry.attributes.normal.array;
    for (let ring = 0; ring < rings; ring++) {
      for (let side = 0; side < sides; side++) {
        const angle = (2 * Math.PI * side) / sides,
          cos = Math.cos(angle),
          sin = Math.sin(angle),
          at = 3 * (ring * sides + side);
        for (let axis = 0; axis < 3; axis++) {
          const from = 3 * ring + axis,
            away = cos * across[from] + sin * up[from];
          normal[at + axis] = away;
          place[at + axis] = centres[from] + radius * away;
        }
      }
    }
    if (this.closed) {
      for (const end of [0, 1]) {
        const ring = end ? rings - 1 : 0,
          first = rings * sides + end * (sides + 1);
        const x = across.slice(3 * ring, 3 * ring + 3),
          y = up.slice(3 * ring, 3 * ring + 3);
        const z = vector(x)
          .cross(vector(y))
          .multiplyScalar(end ? 1 : -1);
        for (let corner = 0; corner <= sides; corner++) {
          const at = 3 * (first + corner),
            from = 3 * (ring * sides + corner - 1);
          for (let axis = 0; axis < 3; axis++) place[at + axis] = corner ? place[from + axis] : centres[3 * ring + axis];
          [normal[at], normal[at + 1], normal[at + 2]] = [z.x, z.y, z.z];
        }
      }
    }
    this.geometry.attributes.position.needsUpdate = this.geometry.attributes.normal.needsUpdate = true;
  }
}

class RobotScene {
  constructor(canvas, data) {
    this.data = data;
    this.canvas = canvas;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true });
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = THREE.PCFSoftShadowMap;
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(35, 1, 0.01 * data.size, 60 * data.size);
    this.camera.up.set(0, 0, 1);
    this.#surroundings();
    this.starts = data.starts.map((start) => ({ ...start, local: new THREE.Matrix4().set(...start.pose) }));
    this.levels = data.colours.wrinkling.map(([, rgb]) => look(colourOf(rgb)));
    this.solids = data.solids.map((solid) => this.#solid(solid, false));
    this.rigid = data.solids.filter((solid) => solid.elastic).map((solid) => this.#solid(solid, true));
    this.tubes = data.tubes.map((tube) => {
      const [red, green, blue, opacity] = data.colours.tube;
      const drawn = new Tube(
        tube.frames.length,
        SIDES,
        tube.link === null ? look(colourOf([red, green, blue]), opacity) : this.levels[0],
        true,
      );
      drawn.mesh.renderOrder = 2;
      this.#add(drawn.mesh, true);
      return { ...tube, drawn };
    });
    this.curves = data.curves.map((curve) => {
      const drawn = new Tube(curve.points.length, CURVE_SIDES, look(colourOf(data.colours.line)), true);
      this.#add(drawn.mesh, true);
      return { ...curve, drawn };
    });
    const green = new THREE.MeshLambertMaterial({
        color: data.colours.force,
        emissive: data.colours.force,
        emissiveIntensity: 0.15,
      }),
      width = 0.009 * data.size;
    this.arrow = new THREE.Group();
    this.shaft = new THREE.Mesh(new THREE.CylinderGeometry(width, width, 1, 20), green);
    this.head = new THREE.Mesh(new THREE.ConeGeometry(2.6 * width, 7 * width, 24), green);
    this.arrow.add(this.shaft, this.head);
    this.#add(this.arrow, false);
    this.handle = new THREE.Mesh(new THREE.SphereGeometry(0.016 * data.size, 24, 16), green);
    this.#add(this.handle, false);
    this.thread = new THREE.Line(
      new THREE.BufferGeometry().setFromPoints([new THREE.Vector3(), new THREE.Vector3()]),
      new THREE.LineDashedMaterial({ color: data.colours.force, dashSize: 0.02 * data.size, gapSize: 0.014 * data.size }),
    );
    this.thread.visible = this.thread.frustumCulled = false;
    this.scene.add(this.thread);
    this.tip = new THREE.Vector3();
    this.arrowEnd = new THREE.Vector3();
    this.view = { target: vector(data.centre), turn: 0, rise: 0, distance: 1 };
    this.home();
  }

  #add(object, shadow) {
    object.traverse((part) => {
      part.castShadow = shadow;
    });
    this.scene.add(object);
  }

  #surroundings() {
    const { size, ground, centre, colours } = this.data;
    this.scene.add(new THREE.HemisphereLight(0xffffff, 0xb9bec6, 0.62));
    const sun = new THREE.DirectionalLight(0xffffff, 0.55),
      fill = new THREE.DirectionalLight(0xffffff, 0.18);
    sun.position.set(centre[0] + 0.6 * size, centre[1] - 0.9 * size, ground + 2.6 * size);
    sun.target.position.set(centre[0], centre[1], ground);
    Object.assign(sun.shadow.camera, {
      left: -1.5 * size,
      right: 1.5 * size,
      top: 1.5 * size,
      bottom: -1.5 * size,
      near: 0.1 * size,
      far: 6 * size,
    });
    sun.shadow.mapSize.set(1024, 1024);
    sun.shadow.radius = 4;
    sun.castShadow = true;
    fill.position.set(centre[0] - size, centre[1] - size, ground + size);
    const lines = [];
    for (let row = -6; row <= 6; row++) {
      const at = (row * size) / 6;
      lines.push(at, -size, ground, at, size, ground, -size, at, ground, size, at, ground);
    }
    const floor = new THREE.BufferGeometry().setAttribute("position", new THREE.Float32BufferAttribute(lines, 3));
    const sheet = new THREE.Mesh(new THREE.PlaneGeometry(6 * size, 6 * size), new THREE.ShadowMaterial({ opacity: 0.16 }));
    sheet.position.set(centre[0], centre[1], ground - 1e-3 * size);
    sheet.receiveShadow = true;
    this.shadows = [sun, sheet];
    this.scene.add(
      sun,
      sun.target,
      fill,
      new THREE.LineSegments(floor, new THREE.LineBasicMaterial({ color: colours.floor })),
      sheet,
    );
  }

  #solid(solid, rigid) {
    const geometry = new THREE.BufferGeometry().setAttribute("position", new THREE.Float32BufferAttribute(solid.corners, 3));
    geometry.setIndex(solid.faces);
    geometry.computeVertexNormals();
    const [red, green, blue, opacity] = rigid ? this.data.colours.rigid : solid.colour;
    const material = look(colourOf([red, green, blue]), opacity);
    material.flatShading = solid.flat;
    const mesh = new THREE.Mesh(geometry, material);
    mesh.matrixAutoUpdate = false;
    mesh.renderOrder = rigid ? 1 : 0;
    this.#add(mesh, !rigid);
    return { ...solid, mesh, local: new THREE.Matrix4().set(...solid.pose) };
  }

  // Fixes shapes and starts of segments, which are given where they are at rest, to their frames there.
  attach(frames) {
    for (const { frame, local } of [...this.starts, ...this.solids, ...this.rigid])
      if (frame >= 0) local.premultiply(placed(frames, frame).invert());
  }

  // Frames with the starts of segments behind them.
  #whole(frames) {
    const all = new Float64Array(frames.length + 12 * this.starts.length);
    all.set(frames);
    this.starts.forEach(({ frame, local }, number) => {
      const { elements: e } = frame < 0 ? local : placed(frames, frame).multiply(local);
      all.set([e[0], e[4], e[8], e[1], e[5], e[9], e[2], e[6], e[10], e[12], e[13], e[14]], frames.length + 12 * number);
    });
    return all;
  }

  // frames: 12 numbers each, rotation by rows, then position; null for rest: the translucent robot is not shown
  show({ frames: solved, rest, tip, force, levels }) {
    const { size, fullForce } = this.data,
      world = new THREE.Matrix4(),
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
    this.handle.position.copy(this.tip);
    const newtons = Math.hypot(...force),
      length = newtons > 0 ? size * (0.05 + 0.3 * Math.min(newtons / fullForce, 3)) : 0;
    this.arrow.visible = newtons > 1e-12 * fullForce;
    this.arrowEnd.copy(this.tip);
    if (this.arrow.visible) {
      const along = vector(force).divideScalar(newtons),
        head = 0.063 * size;
      this.arrow.position.copy(this.tip);
      this.arrow.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), along);
      this.shaft.scale.y = length;
      this.shaft.position.y = 0.5 * length;
      this.head.position.y = length + 0.5 * head;
      this.arrowEnd.addScaledVector(along, length + head);
    }
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

  // Turns the camera home: the whole robot, with its rest pose, in the window.
  home() {
    const away = vector(this.data.eye).sub(vector(this.data.centre));
    Object.assign(this.view, { turn: Math.atan2(away.y, away.x), rise: Math.atan2(away.z, Math.hypot(away.x, away.y)) });
    this.view.fit = true;
    this.dirty = true;
  }

  fit() {
    // the smallest distance at which all is in the window, below its title
    const points = [this.arrowEnd.clone(), this.tip.clone()],
      { width, height } = this,
      { turn, rise } = this.view;
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
    const towards = new THREE.Vector3(Math.cos(turn) * Math.cos(rise), Math.sin(turn) * Math.cos(rise), Math.sin(rise));
    const right = new THREE.Vector3(-Math.sin(turn), Math.cos(turn), 0),
      up = towards.clone().cross(right);
    const seen = points.map((point) => [right, up, towards].map((axis) => point.dot(axis)));
    const middle = [0, 1, 2].map(
      (axis) => 0.5 * (Math.min(...seen.map((one) => one[axis])) + Math.max(...seen.map((one) => one[axis]))),
    );
    const slope = Math.tan(0.5 * THREE.MathUtils.degToRad(this.camera.fov));
    const high = slope * Math.max(0.5, 1 - 160 / height),
      wide = slope * this.camera.aspect * Math.max(0.5, 1 - 110 / width);
    this.view.distance = Math.max(
      ...seen.map(([x, y, z]) => z - middle[2] + Math.max(Math.abs(x - middle[0]) / wide, Math.abs(y - middle[1]) / high)),
    );
    const low = this.view.distance * slope * Math.min(0.12, 30 / height); // the title takes more room than the hint
    this.view.target
      .set(0, 0, 0)
      .addScaledVector(right, middle[0])
      .addScaledVector(up, middle[1] + low)
      .addScaledVector(towards, middle[2]);
  }

  turn(right, up) {
    this.view.turn -= right;
    this.view.rise = Math.max(-1.5, Math.min(1.5, this.view.rise + up));
    this.view.fit = false;
    this.dirty = true;
  }

  zoom(factor) {
    this.view.distance = Math.max(0.15 * this.data.size, Math.min(20 * this.data.size, this.view.distance * factor));
    this.view.fit = false;
    this.dirty = true;
  }

  shift(right, up) {
    // in pixels
    const scale =
      (2 * this.view.distance * Math.tan(0.5 * THREE.MathUtils.degToRad(this.camera.fov))) / this.canvas.clientHeight;
    const [x, y] = this.axes();
    this.view.target.addScaledVector(x, -right * scale).addScaledVector(y, up * scale);
    this.view.fit = false;
    this.dirty = true;
  }

  axes() {
    // of the screen, in the world: right, up, towards the viewer
    return [0, 1, 2].map((column) => new THREE.Vector3().setFromMatrixColumn(this.camera.matrixWorld, column));
  }

  // Without shadows, where a browser draws in software.
  simplify() {
    const [sun, sheet] = this.shadows;
    sun.castShadow = sheet.visible = false;
    this.dirty = true;
  }

  draw() {
    const { clientWidth: width, clientHeight: height } = this.canvas,
      ratio = Math.min(devicePixelRatio || 1, 2);
    if (!width || !height) return;
    if (this.width !== width || this.height !== height || this.ratio !== ratio) {
      Object.assign(this, { width, height, ratio });
      this.renderer.setPixelRatio(ratio);
      this.renderer.setSize(width, height, false);
      this.camera.aspect = width / height;
      this.camera.updateProjectionMatrix();
      this.refit = true;
    }
    if (this.view.fit && this.refit) {
      this.fit();
      this.refit = false;
    }
    const { target, turn, rise, distance } = this.view;
    this.camera.position
      .set(Math.cos(turn) * Math.cos(rise), Math.sin(turn) * Math.cos(rise), Math.sin(rise))
      .multiplyScalar(distance)
      .add(target);
    this.camera.lookAt(target);
    this.camera.updateMatrixWorld();
    this.renderer.render(this.scene, this.camera);
    this.dirty = false;
  }

  onScreen(point) {
    // [px]
    const seen = point.clone().project(this.camera);
    return [0.5 * (seen.x + 1) * this.canvas.clientWidth, 0.5 * (1 - seen.y) * this.canvas.clientHeight];
  }

  under(x, y) {
    // the point of the plane through the tip, square to the view, that is seen at a pixel
    const [, , towards] = this.axes(),
      plane = new THREE.Plane().setFromNormalAndCoplanarPoint(towards, this.tip);
    const ray = new THREE.Raycaster();
    ray.setFromCamera(
      new THREE.Vector2((2 * x) / this.canvas.clientWidth - 1, 1 - (2 * y) / this.canvas.clientHeight),
      this.camera,
    );
    return ray.ray.intersectPlane(plane, new THREE.Vector3());
  }

  stretch(pointer) {
    // the thread from the tip to the pointer; null: none
    this.thread.visible = pointer !== null;
    if (pointer) {
      this.thread.geometry.setFromPoints([this.tip, pointer]);
      this.thread.computeLineDistances();
    }
    this.dirty = true;
  }
}
