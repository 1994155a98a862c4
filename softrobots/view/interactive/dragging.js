// The tip: pulled by a spring to the pointer, or moved there by the motors.
let dragging = null;
const mode = () => document.querySelector("#mode input:checked").value;
$("mode").addEventListener("change", () => $("tip").classList.toggle("motors", mode() === "motors"));

function pull(target) {
  const stiffness = data.fullForce / (0.25 * data.size);
  const goal = target.toArray().map((one, axis) => stiffness * (one - shown.tip[axis]) + dragging.held[axis]),
    size = Math.hypot(...goal);
  const most = Math.min(1, (2 * data.fullForce) / Math.max(size, 1e-300));
  const before = wanted.force;
  wanted.force = before.map((one, axis) => one + 0.35 * (most * goal[axis] - one));
  if (Math.hypot(...wanted.force.map((one, axis) => one - before[axis])) < 1e-4 * data.fullForce) {
    wanted.force = before;
    return false;
  }
  return true;
}

function reach(target) {
  // one step of damped least squares on certified equilibria, motors in units of their ranges
  const error = target.toArray().map((one, axis) => one - shown.tip[axis]),
    size = Math.hypot(...error);
  if (size < 1e-4 * data.size) return false;
  const most = Math.min(1, (0.08 * data.size) / size),
    ranges = actuators.map((one) => one.high - one.low);
  const ways =
    data.basis === null
      ? actuators.map((_, at) => actuators.map((__, one) => (one === at ? ranges[at] : 0)))
      : data.basis[0].map((_, k) => data.basis.map((row) => row[k] * Math.max(...ranges)));
  const moved = (steps) => wanted.motors.map((one, at) => one + ways.reduce((sum, way, k) => sum + steps[k] * way[at], 0));
  const columns = ways.map((_, k) => {
    const near = answer({ ...plain(wanted), motors: moved(ways.map((__, at) => (at === k ? 1e-4 : 0))) }, shown);
    return good(near) ? near.tip.map((one, axis) => (one - shown.tip[axis]) / 1e-4) : [0, 0, 0];
  });
  const square = [0, 1, 2].map((i) =>
    [0, 1, 2].map((j) => columns.reduce((sum, one) => sum + one[i] * one[j], i === j ? (0.1 * data.size) ** 2 : 0)),
  );
  const weights = vector(error).multiplyScalar(most).applyMatrix3(new THREE.Matrix3().set(...square.flat()).invert()).toArray();
  const steps = columns.map((one) => one.reduce((sum, entry, axis) => sum + entry * weights[axis], 0));
  for (let share = 1; share > 0.05; share /= 2) {
    let motors = moved(steps.map((one) => share * one));
    if (data.basis === null)
      motors = motors.map((one, at) =>
        Math.max(actuators[at].lower ?? -Infinity, Math.min(actuators[at].upper ?? Infinity, one)),
      );
    else if (motors.some((one, at) => one < actuators[at].lower || one > actuators[at].upper)) continue;
    const found = answer({ ...plain(wanted), motors }, shown);
    if (good(found) && Math.hypot(...target.toArray().map((one, axis) => one - found.tip[axis])) < size) {
      wanted.motors = motors;
      return true;
    }
  }
  return false;
}

const local = (event) => {
  const box = $("canvas").getBoundingClientRect();
  return [event.clientX - box.left, event.clientY - box.top];
};

function capture(event) {
  try {
    event.currentTarget.setPointerCapture(event.pointerId);
  } catch {
    /* a pointer that is no longer down */
  }
}

const tip = $("tip"),
  canvas = $("canvas");
tip.addEventListener("pointerdown", (event) => {
  if (!shown || event.button > 0) return;
  const [x, y] = local(event),
    [tx, ty] = scene.onScreen(scene.tip);
  dragging = { offset: [tx - x, ty - y], at: null, held: [...wanted.force] }; // the spring carries what is there
  capture(event);
  tip.classList.add("dragged");
});

tip.addEventListener("pointermove", (event) => {
  if (!dragging) return;
  const [x, y] = local(event);
  dragging.at = [x + dragging.offset[0], y + dragging.offset[1]];
  scene.dirty = true;
});

const release = () => {
  dragging = null;
  tip.classList.remove("dragged");
  scene.stretch(null);
  keep();
};

for (const name of ["pointerup", "pointercancel", "lostpointercapture"]) tip.addEventListener(name, release);
tip.addEventListener("keydown", (event) => {
  const ways = {
    ArrowRight: [0, 1],
    ArrowLeft: [0, -1],
    ArrowUp: [1, 1],
    ArrowDown: [1, -1],
    PageUp: [2, 1],
    PageDown: [2, -1],
  }[event.key];
  if (!ways || !shown) return;
  event.preventDefault();
  const along = scene.axes()[ways[0]].multiplyScalar(ways[1] * (event.shiftKey ? 0.1 : 1));
  if (mode() === "force")
    wanted.force = wanted.force.map((one, axis) => one + 0.1 * data.fullForce * along.getComponent(axis));
  else reach(scene.tip.clone().addScaledVector(along, 0.02 * data.size));
  refresh();
});
