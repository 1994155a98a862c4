// Shapes in three.js: materials, frames, rigid bodies, and tubes along bodies and actuators.
const { THREE } = MeshCat;
const SIDES = 28,
  CURVE_SIDES = 8;
const vector = (numbers) => new THREE.Vector3(...numbers);
const colourOf = (rgb) => new THREE.Color(...rgb.slice(0, 3));

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
    this.dash(false);
    this.mesh = new THREE.Mesh(this.geometry, material);
    this.mesh.frustumCulled = false;
  }

  // About two dozen dashes along the tube, or one piece.
  dash(dashed) {
    if (dashed === this.dashed) return;
    this.dashed = dashed;
    this.geometry.setIndex(this.triangles(dashed ? Math.max(1, Math.round(this.rings / 47)) : Infinity));
  }

  // long: rings from gap to gap
  triangles(long) {
    const index = [],
      { rings, sides } = this;
    for (let ring = 0; ring + 1 < rings; ring++) {
      if (Math.floor(ring / long) % 2) continue;
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

// A rigid shape, which `placed` frames move.
function rigidMesh(solid, [red, green, blue, opacity]) {
  const geometry = new THREE.BufferGeometry().setAttribute("position", new THREE.Float32BufferAttribute(solid.corners, 3));
  geometry.setIndex(solid.faces);
  geometry.computeVertexNormals();
  const mesh = new THREE.Mesh(geometry, look(colourOf([red, green, blue]), opacity));
  mesh.material.flatShading = solid.flat;
  mesh.matrixAutoUpdate = false;
  return { ...solid, mesh, local: new THREE.Matrix4().set(...solid.pose) };
}
