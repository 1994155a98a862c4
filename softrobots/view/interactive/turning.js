// The picture: pointers and keys turn, shift and zoom it.
const pointers = new Map();
canvas.addEventListener("pointerdown", (event) => {
  pointers.set(event.pointerId, local(event));
  capture(event);
});

for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, (event) => pointers.delete(event.pointerId));
canvas.addEventListener("pointermove", (event) => {
  const before = pointers.get(event.pointerId),
    now = local(event);
  if (!before) return;
  const [dx, dy] = [now[0] - before[0], now[1] - before[1]],
    other = [...pointers].find(([id]) => id !== event.pointerId)?.[1];
  pointers.set(event.pointerId, now);
  if (other) {
    const apart = (place) => Math.max(8, Math.hypot(place[0] - other[0], place[1] - other[1]));
    scene.zoom(apart(before) / apart(now));
    scene.shift(0.5 * dx, 0.5 * dy);
  } else if (event.shiftKey || event.buttons > 1) scene.shift(dx, dy);
  else scene.turn(0.008 * dx, 0.008 * dy);
});

canvas.addEventListener("contextmenu", (event) => event.preventDefault());
canvas.addEventListener(
  "wheel",
  (event) => {
    // in a page around it, scrolling scrolls that page until the picture is chosen
    if (embedded && document.activeElement !== canvas && !event.ctrlKey) return;
    event.preventDefault();
    scene.zoom(Math.exp(0.0012 * Math.max(-200, Math.min(200, event.deltaY))));
  },
  { passive: false },
);
canvas.addEventListener("keydown", (event) => {
  const acts = {
    ArrowLeft: () => scene.turn(-0.1, 0),
    ArrowRight: () => scene.turn(0.1, 0),
    ArrowUp: () => scene.turn(0, 0.1),
    ArrowDown: () => scene.turn(0, -0.1),
    "+": () => scene.zoom(0.9),
    "=": () => scene.zoom(0.9),
    "-": () => scene.zoom(1.1),
    Home: whole,
  };
  if (!acts[event.key]) return;
  event.preventDefault();
  acts[event.key]();
});

const whole = () => {
  scene.home();
  scene.refit = true;
};
