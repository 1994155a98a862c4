// Reset, and the state in the address.
const set = (setting) => {
  Object.assign(wanted, structuredClone(setting));
  refresh();
};

const restart = () => {
  set(data.start);
  shown = null;
  solveShown();
  whole();
  keep();
};

function show(given) {
  // refuses bad input before anything moves
  const setting = input(given),
    by = (list) => Object.fromEntries(names.map((name, place) => [name, list[place]]));
  if (mapping(setting.motors)) setting.motors = { ...by(wanted.motors), ...setting.motors };
  solver.solve({ ...plain(wanted), ...setting });
  if (setting.motors)
    setting.motors = mapping(setting.motors) ? names.map((name) => setting.motors[name]) : Array.from(setting.motors);
  if (setting.force) setting.force = Array.from(setting.force);
  set({
    ...wanted,
    ...setting,
    gravity: "gravity" in given ? ((setting.gravity && Array.from(setting.gravity)) ?? null) : wanted.gravity,
  });
}

$("reset").addEventListener("click", restart);
$("release").addEventListener("click", () => {
  set({ force: [0, 0, 0] });
  keep();
});

$("whole").addEventListener("click", whole);
const listed = (list) => list.map((one) => Number(one.toPrecision(9)));
const state = () => `#motors=${listed(wanted.motors)}&force=${listed(wanted.force)}&gravity=${wanted.gravity ?? "off"}`;
function keep() {
  try {
    history.replaceState(null, "", state());
  } catch {
    /* a page without an address */
  }
}

$("panel").addEventListener("change", () => keep());
$("copy").addEventListener("click", async () => {
  keep();
  const text = location.href.split("#")[0] + state();
  try {
    await navigator.clipboard.writeText(text);
    $("copy").textContent = "Copied";
  } catch {
    prompt("Link to this state:", text);
  }
  setTimeout(() => {
    $("copy").textContent = "Copy link";
  }, 1500);
});

function readAddress() {
  const given = Object.fromEntries(new URLSearchParams(location.hash.slice(1))),
    list = (text) => (text === "" ? [] : text.split(",").map(Number));
  try {
    const setting = Object.fromEntries(
      Object.entries(given).map(([name, text]) => [name, text === "off" ? null : list(text)]),
    );
    show(setting);
    if (solver.rubs) shown = null; // a link does not tell what friction remembers
  } catch (error) {
    console.warn(`the state in the address is not read: ${error.message}`);
  }
}
