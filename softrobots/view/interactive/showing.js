// The picture of what is shown: its pose, the robot at rest, the colours of wrinkling.
const scene = new RobotScene($("canvas"), data);
scene.attach(solver.solve({ motors: relaxed }).placements);

let unloadedAt = null,
  unloaded = null;
function atRest() {
  // the robot without load, with the motors that are shown
  const key = String(shownFor.motors);
  if (key !== unloadedAt) {
    unloadedAt = key;
    const found = answer({ motors: shownFor.motors });
    unloaded = good(found) ? found.placements : null;
  }
  return unloaded;
}

function draw() {
  if (!shown) return;
  scene.show({
    frames: shown.placements,
    rest: scene.rigid.length && $("rest").checked ? atRest() : null,
    tip: shown.tip,
    force: shownFor.force,
    levels: shares(shown).map(level),
  });
  showTensions(shown);
  $("canvas").classList.toggle("failed", failed !== "");
}

const level = (share) => {
  const at = data.colours.wrinkling.findIndex(([least]) => share >= least);
  return share <= 0 || at < 0 ? data.colours.wrinkling.length - 1 : at;
};

const shares = (found) => found.links.map((link) => link.wrinklingMargin);
