// The robot, the state that is asked for and the one that is shown: each an equilibrium, found from the last one.
const data = JSON.parse(PAGE_DATA),
  solver = makeSolver(),
  $ = (id) => document.getElementById(id);
const { actuators } = data,
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

const good = (found) => found.status === 0 || found.status === 8;
const plain = ({ motors, force, gravity }) => ({ motors, force, gravity: gravity ?? [0, 0, 0] });
function answer(setting, from) {
  const found = solver.solve(from ? { ...setting, from } : setting);
  if (good(found) && ![...found.tip, ...found.placements].every(Number.isFinite))
    return { ...found, status: 4, statusText: solver.statuses[4].text };
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
