// The camera: where it looks from, what is seen at a pixel, and drawing.
class Camera {
  constructor(canvas, data) {
    this.data = data;
    this.canvas = canvas;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true });
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = THREE.PCFSoftShadowMap;
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(35, 1, 0.01 * data.size, 60 * data.size);
    this.camera.up.set(0, 0, 1);
    this.shadows = surroundings(this.scene, data);
    this.tip = new THREE.Vector3();
    this.view = { target: vector(data.centre), turn: 0, rise: 0, distance: 1 };
    this.home();
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
    const { width, height } = this,
      { turn, rise } = this.view;
    const towards = new THREE.Vector3(Math.cos(turn) * Math.cos(rise), Math.sin(turn) * Math.cos(rise), Math.sin(rise));
    const right = new THREE.Vector3(-Math.sin(turn), Math.cos(turn), 0),
      up = towards.clone().cross(right);
    const seen = this.points().map((point) => [right, up, towards].map((axis) => point.dot(axis)));
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

  // Whether something of the robot is outside of the window.
  leaves() {
    return this.points().some((point) => {
      const { x, y } = point.project(this.camera);
      return Math.max(Math.abs(x), Math.abs(y)) > 1;
    });
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
    if (this.view.fit && (this.refit || (!this.held && this.leaves()))) {
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
}
