// Sliders, each a range and a field of numbers, and the choice of gravity.
function slider(parent, { name, unit, low, high, step, lower, upper }, read, write) {
  const row = document.createElement("div"),
    label = document.createElement("span"),
    small = document.createElement("small");
  const box = document.createElement("span"),
    range = document.createElement("input"),
    field = document.createElement("input"),
    abbr = document.createElement("abbr");
  row.className = "row";
  box.className = "number";
  range.type = "range";
  field.type = "number";
  abbr.textContent = unit;
  label.append(name.replaceAll("_", " "), small);
  Object.assign(range, { min: low, max: high, step });
  field.step = "any";
  range.setAttribute("aria-label", `${name} [${unit}]`);
  field.setAttribute("aria-label", `${name} [${unit}], as a number`);
  box.append(field, abbr);
  row.append(label, box, range);
  parent.append(row);
  range.addEventListener("input", () => {
    write(range.valueAsNumber);
    refresh();
  });
  field.addEventListener("input", () => {
    if (Number.isFinite(field.valueAsNumber)) {
      write(field.valueAsNumber);
      refresh(field);
    }
  });
  field.addEventListener("change", () => refresh());
  return (kept) => {
    const value = read(),
      digits = Math.max(0, Math.min(6, Math.ceil(-Math.log10(step))));
    range.value = value;
    range.setAttribute("aria-valuetext", `${short(value)} ${unit}`);
    if (kept !== field) field.value = Number(value.toFixed(digits));
    small.textContent =
      unit === "rad"
        ? `${fixed((value * 180) / Math.PI, 0)}°`
        : unit === "m" && Math.abs(high) < 2
          ? `${fixed(1000 * value, 1)} mm`
          : "";
    const beyond = value < (lower ?? -Infinity) - 1e-9 || value > (upper ?? Infinity) + 1e-9;
    if (beyond) small.textContent += " beyond its limits";
    small.classList.toggle("beyond", beyond);
  };
}

const moveMotor = (place, value) => {
  const change = wanted.motors.map(() => 0);
  change[place] = value - wanted.motors[place];
  if (data.basis === null) wanted.motors[place] = value;
  else {
    // lengths that depend on each other: the others follow
    const row = data.basis[place],
      size = row.reduce((sum, one) => sum + one * one, 0) || 1;
    wanted.motors = wanted.motors.map(
      (one, at) => one + (change[place] / size) * data.basis[at].reduce((sum, entry, k) => sum + entry * row[k], 0),
    );
  }
};

const sliders = actuators.map((one, place) =>
  slider(
    $("motors"),
    one,
    () => wanted.motors[place],
    (value) => moveMotor(place, value),
  ),
);
["x", "y", "z"].forEach((axis, place) =>
  sliders.push(
    slider(
      $("force"),
      { name: `force ${axis}`, unit: "N", low: -data.fullForce, high: data.fullForce, step: data.forceStep },
      () => wanted.force[place],
      (value) => {
        wanted.force[place] = value;
      },
    ),
  ),
);
const earth = Math.hypot(...data.earth),
  directions = [
    ["off", null],
    ["down", [0, 0, -1]],
    ["up", [0, 0, 1]],
    ["along x", [1, 0, 0]],
    ["against x", [-1, 0, 0]],
    ["along y", [0, 1, 0]],
    ["against y", [0, -1, 0]],
  ].map(([text, way]) => [text, way && way.map((one) => one * earth || 0)]);
const choices = () =>
  directions.some(([, way]) => JSON.stringify(way) === JSON.stringify(wanted.gravity))
    ? directions
    : [...directions, ["as given", wanted.gravity]];
let offered = "";
function refresh(kept) {
  sliders.forEach((update) => update(kept));
  const list = choices(),
    text = JSON.stringify(list);
  if (text !== offered) {
    offered = text;
    $("gravity").replaceChildren(
      ...list.map(
        ([words, way]) => new Option(way ? `${words}, ${short(Math.hypot(...way))} m/s²` : words, JSON.stringify(way)),
      ),
    );
  }
  $("gravity").value = JSON.stringify(wanted.gravity);
  asked = true;
}

$("gravity").addEventListener("change", () => {
  wanted.gravity = JSON.parse($("gravity").value);
  refresh();
});

$("rest").addEventListener("change", draw);
$("motors").hidden = !actuators.length;
$("mode").hidden = solver.rubs || !actuators.length;
$("friction").hidden = !solver.rubs;
$("rest-row").hidden = !data.solids.some((solid) => solid.elastic);
