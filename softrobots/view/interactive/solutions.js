// The robot, the state that is asked for and the one that is shown: each an equilibrium, found from the last one.
const data = JSON.parse(PAGE_DATA),
  solver = makeSolver(),
  $ = (id) => document.getElementById(id);
const actuators = solver.actuators.map((one, place) => ({ ...one, ...data.sliders[place] })),
  names = actuators.map((one) => one.name),
  relaxed = actuators.map((one) => one.relaxed);
const wanted = {
  motors: [...data.start.motors],
  force: [...data.start.force],
  gravity: data.start.gravity && [...data.start.gravity],
};
let shown = null,
  shownFor = null,
  failed = "",
  rates = 0,
  asked = true;

const [CERTIFIED, NOT_A_NUMBER, NEUTRAL] = ["CERTIFIED", "NOT_A_NUMBER", "NEUTRAL"].map((name) =>
  solver.statuses.findIndex((status) => status.name === name),
);
const good = (found) => found.status === CERTIFIED || found.status === NEUTRAL;
const plain = ({ motors, force, gravity }) => ({ motors, force, gravity: gravity ?? [0, 0, 0] });
function answer(setting, from) {
  const found = solver.solve(from ? { ...setting, from } : setting);
  if (good(found) && ![...found.tip, ...found.placements].every(Number.isFinite))
    return { ...found, status: NOT_A_NUMBER, statusText: solver.statuses[NOT_A_NUMBER].text };
  return found;
}

function following(setting) {
  // from what is shown, or else from rest
  const near = shown ? answer(setting, shown) : null;
  return near && good(near) ? near : answer(setting);
}

// With dry friction a change is a way: straight on in steps of a fiftieth of each slider, each from what friction remembers of
// the last; gravity has no slider and counts twice the earth's. A step that does not settle is one with the next.
const FINE = 50,
  MOST = 1000, // steps; a number far beyond its slider takes longer ones
  untouched = { motors: relaxed, force: [0, 0, 0], gravity: [0, 0, 0] };
const ranges = {
  motors: actuators.map((one) => Math.max(one.high - one.low, one.step)),
  force: Array(3).fill(2 * data.fullForce),
  gravity: Array(3).fill(2 * Math.hypot(...data.earth)),
};
function walk(setting, last, at) {
  const begin = at,
    parts = Object.keys(ranges),
    shares = parts.flatMap((name) => ranges[name].map((range, k) => Math.abs(setting[name][k] - begin[name][k]) / range)),
    steps = Math.min(MOST, Math.max(1, Math.ceil(FINE * Math.max(...shares) - 1e-9)));
  let found,
    missed = 0;
  for (let step = 1; step <= steps && missed < 2; step += 1) {
    const back = 1 - step / steps, // from the end, which is met to the last bit
      on = (name) => setting[name].map((one, k) => one + back * (begin[name][k] - one)),
      next = Object.fromEntries(parts.map((name) => [name, on(name)]));
    found = answer(next, last);
    missed = good(found) ? 0 : missed + 1;
    if (!missed) [last, at] = [found, next];
  }
  return { found, last, at };
}

function went(setting) {
  // as far as the way leads, what is shown
  const { found, last, at } = shown ? walk(setting, shown, plain(shownFor)) : walk(setting, null, untouched);
  [shown, shownFor] = [last, { ...at, gravity: at.gravity.some(Boolean) ? at.gravity : null }];
  return found;
}

function solveShown() {
  const begin = performance.now(),
    found = (solver.rubs ? went : following)(plain(wanted)),
    time = performance.now() - begin;
  rates = rates ? 0.8 * rates + 0.2 * time : time;
  if (!good(found) && !shown)
    [shown, shownFor] = [answer({ motors: relaxed }), { motors: relaxed, force: [0, 0, 0], gravity: null }];
  if (good(found)) {
    shown = found;
    shownFor = structuredClone(wanted);
    failed = "";
  } else {
    failed = found.statusText;
  }
  report(found);
  draw();
  return found;
}
