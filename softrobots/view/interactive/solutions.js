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

function solveShown() {
  const begin = performance.now(),
    found = following(plain(wanted)),
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
