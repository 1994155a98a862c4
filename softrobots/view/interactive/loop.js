// The window: its panel, and the loop that solves when something is asked for and draws when something has changed.
const embedded = window !== window.top;
const open = (wide) => {
  document.body.classList.toggle("closed", !wide);
  $("toggle").setAttribute("aria-expanded", wide);
  $("toggle").textContent = wide ? "Hide controls" : "Controls";
  scene.dirty = true;
};

$("toggle").addEventListener("click", () => open(document.body.classList.contains("closed")));
addEventListener("resize", () => {
  scene.dirty = true;
});

addEventListener("hashchange", readAddress);

let last = 0,
  slow = 0;
function frame(now) {
  if (scene.held && !dragging) scene.dirty = true; // let go of: the camera may follow
  scene.held = dragging !== null; // under a pointer the picture stays
  if (dragging?.at && shown) {
    const target = scene.under(...dragging.at);
    if (target && (mode() === "force" ? pull(target) : reach(target))) refresh();
    scene.stretch(target);
  }
  if (asked) {
    asked = false;
    attempt(solveShown);
  }
  if (scene.dirty) {
    slow = now - last < 400 && now - last > 45 ? slow + 1 : 0; // between two drawn frames [ms]
    last = now;
    if (slow === 8) scene.simplify();
    scene.draw();
    const [x, y] = scene.onScreen(scene.tip),
      [ax, ay] = scene.onScreen(scene.arrow.end),
      newtons = Math.hypot(...(shownFor?.force ?? [0]));
    tip.style.transform = `translate(${x}px, ${y}px)`;
    $("newtons").hidden = !scene.arrow.visible;
    $("newtons").textContent = `${Number(newtons.toPrecision(3))} N`;
    const wide = $("newtons").offsetWidth,
      left = Math.max(4, Math.min(canvas.clientWidth - wide - 4, ax - (ax < x ? wide + 6 : -6)));
    $("newtons").style.transform = `translate(${left}px, ${Math.max(4, Math.min(canvas.clientHeight - 26, ay - 12))}px)`;
  }
  requestAnimationFrame(frame);
}

function attempt(work) {
  try {
    work();
  } catch (error) {
    report({
      status: -1,
      statusText: String(error.message ?? error),
      tip: shown?.tip ?? [0, 0, 0],
      residual: 0,
      minPivot: 0,
    });
    console.error(error);
  }
}

document.body.classList.toggle("embedded", embedded);
open(innerWidth > 720 || innerHeight > 640);
refresh();
readAddress();
attempt(solveShown);
scene.refit = true;
frame(performance.now());
