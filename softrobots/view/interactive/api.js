// `window.softrobots`: what a script in the page, or around it, can ask.
const mapping = (value) => value !== null && typeof value === "object" && !(Symbol.iterator in value);

// What is given to `solve` and `set`; the solver checks the numbers.
function input(given) {
  if (!mapping(given)) throw new TypeError(`${String(given)} came; required: an object with motors, force, gravity`);
  const strange = Object.keys(given).filter((name) => !["motors", "force", "gravity"].includes(name));
  if (strange.length) throw new TypeError(`${strange.join(", ")} came; available: motors, force, gravity`);
  return Object.fromEntries(Object.entries(given).filter(([, value]) => value !== undefined && value !== null));
}

Object.defineProperties(
  window.softrobots,
  Object.getOwnPropertyDescriptors({
    robot: { name: solver.name, actuators: solver.actuators, springs: solver.springs },
    solve: (given = {}) => answer({ motors: relaxed, ...input(given) }),
    set(given = {}) {
      show(given);
      asked = false;
      const found = solveShown();
      keep();
      return found;
    },
    view: scene,
    get shown() {
      return shown && { ...shownFor, tip: [...shown.tip], drawnTip: scene.arrow.handle.position.toArray(), failed };
    },
  }),
);
