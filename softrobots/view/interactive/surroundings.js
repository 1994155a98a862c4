// Light, shadows and the floor.
function surroundings(scene, { size, ground, centre, colours }) {
  scene.add(new THREE.HemisphereLight(0xffffff, 0xb9bec6, 0.62));
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
  const sheet = new THREE.Mesh(new THREE.PlaneGeometry(6 * size, 6 * size), new THREE.ShadowMaterial({ opacity: 0.16, depthWrite: false }));
  sheet.position.set(centre[0], centre[1], ground - 1e-3 * size);
  sheet.receiveShadow = true;
  scene.add(
    sun,
    sun.target,
    fill,
    new THREE.LineSegments(floor, new THREE.LineBasicMaterial({ color: colours.floor })),
    sheet,
  );
  return [sun, sheet];
}
