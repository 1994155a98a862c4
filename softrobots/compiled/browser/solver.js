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
    const required = count ? `${count} finite numbers [${unit}]${names ? `: ${names.join(", ")}` : ""}` : `[], the robot has no ${name}`;
    throw new TypeError(`${name}: ${came} came; required: ${required}`);
  }
  return listed;
}

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const plus = (a, b, share) => a.map((one, i) => one + share * b[i]);

// v turned by an angle about a unit axis.
function turned(v, axis, angle) {
  const across = cross(axis, v);
  return plus(plus(v, across, Math.sin(angle)), cross(axis, across), 1.0 - Math.cos(angle));
}

// Axis of a link at a hinge, outwards; see model/link_limits.py.
function axisAt(hinge, placements, strains) {
  const position = (frame) => (frame < 0 ? [0.0, 0.0, 0.0] : Array.from(placements.subarray(12 * frame + 9, 12 * frame + 12)));
  const turn = (frame, v) => [0, 3, 6].map((row) => dot(placements.subarray(12 * frame + row, 12 * frame + row + 3), v));
  const [inner, outer] = hinge.joints;
  const [first, last] = hinge.joints.map((one) => turn(one.frame, one.axis));
  let outwards = plus(position(inner.frame), position(hinge.before), -1.0);
  if (Math.hypot(...outwards) < 1e-9) {
    outwards = turn(outer.frame, hinge.lever);
  }
  let between = cross(first, last);
  if (Math.hypot(...between) < 1e-9) {
    between = turned(plus(outwards, first, -dot(first, outwards)), first, strains[inner.strain]);
  }
  const axis = plus(turned(between, first, -strains[inner.strain]), turned(between, last, strains[outer.strain]), 1.0);
  const size = Math.hypot(...axis);
  return size > 1e-12 ? axis.map((one) => ((dot(axis, outwards) < 0.0 ? -1.0 : 1.0) * one) / size) : [0.0, 0.0, 0.0];
}

// Moments at the hinges of each link; along sections of a segment linear between their middles.
function momentsOf(loads) {
  const moments = ROBOT.links.map((link) => link.strains.map((hinge) => Math.hypot(...hinge.map((strain) => loads[strain]))));
  for (const segment of new Set(ROBOT.links.map((link) => link.segment).filter((one) => one !== null))) {
    const rows = ROBOT.links.flatMap((link, row) => (link.segment === segment ? [row] : []));
    const m = rows.map((row) => Math.max(...moments[row]));
    const end = (near, far) => (rows.length < 2 ? near : 1.5 * near - 0.5 * far);
    rows.forEach((row, k) => {
      const before = k > 0 ? 0.5 * (m[k - 1] + m[k]) : end(m[0], m[1]);
      const behind = k + 1 < m.length ? 0.5 * (m[k] + m[k + 1]) : end(m[k], m[k - 1]);
      moments[row] = moments[row].map(() => Math.max(before, behind, m[k]));
    });
  }
  return moments;
}

// What each inflated link carries at its worst hinge, as Equilibrium.link_limits.
function limitsOf(loads, strains, placements, force, gravity) {
  const moments = momentsOf(loads);
  return ROBOT.links.map((link, row) => {
    const hinges = moments[row].map((moment, k) => {
      const hinge = link.hinges === null ? null : link.hinges[k];
      const axialForce = hinge === null ? loads[link.stretch] : dot(axisAt(hinge, placements, strains), plus(force, gravity, hinge.mass));
      const carried = Math.max(link.pressure * Math.PI * link.radius ** 2 + axialForce, 0.0) * link.radius;
      const limit = link.pressure > 0.0 ? carried : 0.0;
      const left = (share) => (limit > 0.0 ? 1.0 - moment / (share * limit) : -Infinity);
      return { name: link.name, moment, axialForce, slackMargin: left(0.5), wrinklingMargin: left(0.25 * Math.PI) };
    });
    return hinges.reduce((worst, one) => (one.wrinklingMargin < worst.wrinklingMargin ? one : worst));
  });
}

// Tension of each muscle at the point that was evaluated last.
function tensionsOf(w) {
  const { place, sums, shares } = ROBOT.tensions;
  if (sums === null) {
    return Array.from(w.subarray(place, place + ROBOT.muscles));
  }
  const loads = sums.map((sum, k) => w[place + k] - sum.stiffness * (w[$START + sum.unknown] - sum.rest));
  return shares.map((row) => row.reduce((total, share, k) => total + share * loads[k], 0.0));
}

function makeSolver() {
  const w = new Float64Array(ROBOT.size);
  const units = [...new Set(ROBOT.actuators.map((one) => one.unit))].join(", ");
  const names = ROBOT.actuators.map((one) => one.name);

  function put(motors, force, gravity, memory) {
    w.fill(0.0);
    ROBOT.memory.forEach(({ before, rest }, k) => w.set(memory === null ? rest : memory[k], before));
    w.set(motors.slice(0, ROBOT.joints), 0);
    if (ROBOT.muscles > 0) {
      $put_muscles(w, Float64Array.from(motors.slice(ROBOT.joints)));
    }
    w.set(force, $FORCE);
    if (ROBOT.gravity) {
      w.set(gravity, ROBOT.gravityPlace);
    }
  }

  // Whether a shape has the muscle lengths.
  function admitted(motors) {
    const change = ROBOT.misfit === null ? [] : motors.slice(ROBOT.joints).map((one, i) => one - ROBOT.actuators[ROBOT.joints + i].relaxed);
    const gaps = change.map((_, row) => ROBOT.misfit[row].reduce((total, one, i) => total + one * change[i], 0.0));
    const lengths = motors.slice(ROBOT.joints).every((one) => !ROBOT.started || one > 0.0);
    return lengths && gaps.every((gap) => Math.abs(gap) <= ROBOT.consistent);
  }

  function solve({ motors, force = [0.0, 0.0, 0.0], gravity = [0.0, 0.0, 0.0], from = null }) {
    const given = numbers("motors", motors, names.length, units, names);
    const load = numbers("force", force, 3, "N");
    const down = numbers("gravity", gravity, 3, "m/s^2");
    if (!ROBOT.gravity && down.some((one) => one !== 0.0)) {
      throw new TypeError(`gravity: [${down.join(", ")}] came; required: none, this script was written without gravity`);
    }
    if (from !== null && !(from.unknowns instanceof Float64Array && from.unknowns.length === ROBOT.unknowns)) {
      throw new TypeError(`from: ${String(from)} came; required: a result of solve of the same robot`);
    }
    put(given, load, down, from === null ? null : from.memory);
    let status;
    if (!admitted(given)) {
      status = $NOT_A_NUMBER;
    } else if (from === null) {
      status = $settle(w);
    } else {
      for (let i = 0; i < ROBOT.unknowns; i += 1) {
        w[$UNKNOWN + i] = from.unknowns[i] + (ROBOT.started ? w[$START + i] - from.start[i] : 0.0);
      }
      status = $settle_from(w);
    }
    const tip = Array.from(w.subarray($TIP, $TIP + 3));
    const unknowns = w.slice($UNKNOWN, $UNKNOWN + ROBOT.unknowns);
    const memory = ROBOT.memory.map(({ after, rest }) => w.slice(after, after + rest.length));
    const residual = Math.sqrt(w[$ERROR]);
    $look_at_shape(w);
    const placements = w.slice(ROBOT.placementsPlace, ROBOT.placementsPlace + 12 * ROBOT.frames.length);
    const loads = w.slice(ROBOT.loadsPlace, ROBOT.loadsPlace + ROBOT.strains);
    const strains = w.subarray($STRAINS, $STRAINS + ROBOT.strains);
    const links = limitsOf(loads, strains, placements, load, down);
    $evaluate(w); // the pivots of this very point
    return {
      status,
      statusText: ROBOT.statuses[status].text,
      tip,
      springs: w.slice(ROBOT.springsPlace, ROBOT.springsPlace + ROBOT.springs.length),
      residual,
      minPivot: w[$MIN_PIVOT],
      placements,
      links,
      tensions: tensionsOf(w),
      unknowns,
      memory,
      start: w.slice($START, $START + ROBOT.unknowns),
    };
  }

  const { name, actuators, springs, statuses, frames } = ROBOT;
  return { name, actuators, springs, statuses, frames, rubs: ROBOT.memory.length > 0, solve };
}
