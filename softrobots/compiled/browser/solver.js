// Equilibria of one robot. ROBOT and the functions of the kernel, whose names begin with $, stand before this text.

function numbers(name, value, count, unit, names) {
  if (value !== null && typeof value === "object" && names && !(Symbol.iterator in value)) {
    const missing = names.filter((one) => !(one in value));
    const unknown = Object.keys(value).filter((one) => !names.includes(one));
    if (missing.length || unknown.length) {
      throw new TypeError(`${name}: ${unknown.length ? `${unknown.join(", ")} is none of them` : `${missing.join(", ")} is missing`}; required: ${names.join(", ")}`);
    }
    value = names.map((one) => value[one]);
  }
  const listed = value !== null && typeof value === "object" && Symbol.iterator in value ? Array.from(value) : null;
  if (listed === null || listed.length !== count || !listed.every((one) => typeof one === "number" && Number.isFinite(one))) {
    const came = listed === null ? String(value) : `[${listed.map(String).join(", ")}]`;
    throw new TypeError(`${name}: ${came} came; required: ${count} finite numbers [${unit}]${names ? `: ${names.join(", ")}` : ""}`);
  }
  return listed;
}

function makeSolver() {
  const w = new Float64Array(ROBOT.size);
  const units = [...new Set(ROBOT.actuators.map((one) => one.unit))].join(", ");
  const names = ROBOT.actuators.map((one) => one.name);

  function put(motors, force, gravity) {
    w.fill(0.0);
    w.set(motors.slice(0, ROBOT.joints), 0);
    if (ROBOT.muscles > 0) {
      $put_muscles(w, Float64Array.from(motors.slice(ROBOT.joints)));
    }
    w.set(force, $FORCE);
    if (ROBOT.gravity) {
      w.set(gravity, ROBOT.gravityPlace);
    }
  }

  function solve({ motors, force = [0.0, 0.0, 0.0], gravity = [0.0, 0.0, 0.0], from = null }) {
    const given = numbers("motors", motors, names.length, units, names);
    const load = numbers("force", force, 3, "N");
    const down = numbers("gravity", gravity, 3, "m/s^2");
    if (!ROBOT.gravity && down.some((one) => one !== 0.0)) {
      throw new TypeError(`gravity: [${down.join(", ")}] came; required: none, this script was written without gravity`);
    }
    put(given, load, down);
    let status;
    if (from === null) {
      status = $settle(w);
    } else {
      if (!(from.unknowns instanceof Float64Array) || from.unknowns.length !== ROBOT.unknowns) {
        throw new TypeError(`from: ${String(from)} came; required: a result of solve of the same robot`);
      }
      for (let i = 0; i < ROBOT.unknowns; i += 1) {
        w[$UNKNOWN + i] = from.unknowns[i] + (ROBOT.started ? w[$START + i] - from.start[i] : 0.0);
      }
      status = $settle_from(w);
    }
    const tip = Array.from(w.subarray($TIP, $TIP + 3));
    const unknowns = w.slice($UNKNOWN, $UNKNOWN + ROBOT.unknowns);
    const residual = Math.sqrt(w[$ERROR]);
    $look_at_shape(w);
    $evaluate(w); // the pivots of this very point
    return {
      status,
      statusText: ROBOT.statuses[status].text,
      tip,
      springs: w.slice(ROBOT.springsPlace, ROBOT.springsPlace + ROBOT.springs.length),
      residual,
      minPivot: w[$MIN_PIVOT],
      placements: w.slice(ROBOT.placementsPlace, ROBOT.placementsPlace + 12 * ROBOT.frames.length),
      unknowns,
      start: w.slice($START, $START + ROBOT.unknowns),
    };
  }

  const { name, actuators, springs, statuses, frames } = ROBOT;
  return { name, actuators, springs, statuses, frames, solve };
}
