// The page: what it knows of the robot, its sliders, its pointer and keys, and `window.softrobots`.
function startPage() {
  const data = JSON.parse(PAGE_DATA),
    solver = makeSolver(),
    $ = (id) => document.getElementById(id);
  const { actuators } = data,
    names = actuators.map((one) => one.name),
    embedded = window !== window.top;
  const scene = new RobotScene($("canvas"), data);
  scene.attach(solver.solve({ motors: actuators.map((one) => one.relaxed) }).placements);
  const wanted = {
    motors: [...data.start.motors],
    force: [...data.start.force],
    gravity: data.start.gravity && [...data.start.gravity],
  };
  let shown = null,
    shownFor = null,
    failed = "",
    rates = 0,
    asked = true,
    dragging = null;

  // What is given to `solve` and `set`; the solver checks the numbers.
  const mapping = (value) => value !== null && typeof value === "object" && !(Symbol.iterator in value);
  function input(given) {
    if (!mapping(given)) throw new TypeError(`${String(given)} came; required: an object with motors, force, gravity`);
    const strange = Object.keys(given).filter((name) => !["motors", "force", "gravity"].includes(name));
    if (strange.length) throw new TypeError(`${strange.join(", ")} came; available: motors, force, gravity`);
    return Object.fromEntries(Object.entries(given).filter(([, value]) => value !== undefined && value !== null));
  }

  // Solutions.
  const relaxed = actuators.map((one) => one.relaxed),
    good = (found) => found.status === 0 || found.status === 8;
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

  // Drawing.
  function draw() {
    if (!shown) return;
    scene.show({
      frames: shown.placements,
      rest: scene.rigid.length && $("rest").checked ? atRest() : null,
      tip: shown.tip,
      force: shownFor.force,
      levels: shares(shown).map(level),
    });
    $("canvas").classList.toggle("failed", failed !== "");
  }
  const level = (share) => {
    const at = data.colours.wrinkling.findIndex(([least]) => share >= least);
    return share <= 0 || at < 0 ? data.colours.wrinkling.length - 1 : at;
  };
  const shares = (found) => found.links.map((link) => link.wrinklingMargin);
  const css = ([red, green, blue]) => `rgb(${[red, green, blue].map((one) => Math.round(255 * one)).join(" ")})`;
  const short = (value) =>
    value === 0
      ? "0"
      : Math.abs(value) < 1e-3 || Math.abs(value) >= 1e5
        ? value.toExponential(1)
        : String(Number(value.toPrecision(4)));

  function report(found) {
    const box = $("status"),
      state = found.status === 0 ? "good" : found.status === 8 ? "neutral" : "bad";
    box.className = state;
    box.children[1].textContent = found.statusText;
    box.children[2].textContent = state === "bad" ? "the last certified pose stays" : "";
    const [x, y, z] = (shown ?? found).tip.map((one) => one.toFixed(4).replace("-", "\u2212"));
    const rows = [
      ["tip [m]", shown ? `${x}  ${y}  ${z}` : "-"],
      ["residual [N m]", short(found.residual)],
      ["smallest pivot [-]", short(found.minPivot)],
      ["solved in [ms]", rates.toFixed(rates < 10 ? 1 : 0)],
    ];
    $("facts").replaceChildren(
      ...rows.map(([name, text]) => {
        const row = document.createElement("tr"),
          head = document.createElement("th"),
          cell = document.createElement("td");
        head.textContent = name;
        head.scope = "row";
        cell.textContent = text;
        row.append(head, cell);
        return row;
      }),
    );
    if (shown)
      $("links").replaceChildren(
        ...told(shown.links).map(([share, name]) => {
          const line = document.createElement("div"),
            swatch = document.createElement("i");
          swatch.style.background = css(data.colours.wrinkling[level(share)][1]);
          line.append(swatch, share <= 0 ? `${name}: wrinkled` : `${name}: ${Math.round(100 * share)} % left to wrinkling`);
          return line;
        }),
      );
  }
  function told(links) {
    // each link, or of many the nearest to wrinkling
    const rows = links.map((link, number) => [link.wrinklingMargin, data.links[number]]);
    if (rows.length <= 4) return rows;
    const [share, name] = rows.reduce((least, row) => (row[0] < least[0] ? row : least));
    return [[share, `${name}, the nearest of ${rows.length}`]];
  }

  // Sliders: a range and a field of numbers each.
  function slider(parent, { name, unit, low, high, step }, read, write) {
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
          ? `${((value * 180) / Math.PI).toFixed(0)}°`
          : unit === "m" && Math.abs(high) < 2
            ? `${(1000 * value).toFixed(1)} mm`
            : "";
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
  $("motors").hidden = $("mode").hidden = !actuators.length;
  $("rest-row").hidden = !data.solids.some((solid) => solid.elastic);
  const mode = () => document.querySelector("#mode input:checked").value;
  $("mode").addEventListener("change", () => $("tip").classList.toggle("motors", mode() === "motors"));

  // The tip: pulled by a spring to the pointer, or moved there by the motors.
  const solveSmall = (matrix, right) => {
    // Gauss; the matrix is symmetric and positive definite
    const rows = matrix.map((row, at) => [...row, right[at]]),
      n = rows.length;
    for (let k = 0; k < n; k++) {
      for (let i = k + 1; i < n; i++) {
        const share = rows[i][k] / rows[k][k];
        for (let j = k; j <= n; j++) rows[i][j] -= share * rows[k][j];
      }
    }
    const found = Array(n).fill(0);
    for (let k = n - 1; k >= 0; k--)
      found[k] = (rows[k][n] - rows[k].slice(k + 1, n).reduce((sum, one, at) => sum + one * found[k + 1 + at], 0)) / rows[k][k];
    return found;
  };
  function pull(target) {
    const stiffness = data.fullForce / (0.25 * data.size);
    const goal = target.toArray().map((one, axis) => stiffness * (one - shown.tip[axis]) + dragging.held[axis]),
      size = Math.hypot(...goal);
    const most = Math.min(1, (2 * data.fullForce) / Math.max(size, 1e-300));
    const before = wanted.force;
    wanted.force = before.map((one, axis) => one + 0.35 * (most * goal[axis] - one));
    if (Math.hypot(...wanted.force.map((one, axis) => one - before[axis])) < 1e-4 * data.fullForce) {
      wanted.force = before;
      return false;
    }
    return true;
  }
  function reach(target) {
    // one step of damped least squares on certified equilibria, motors in units of their ranges
    const error = target.toArray().map((one, axis) => one - shown.tip[axis]),
      size = Math.hypot(...error);
    if (size < 1e-4 * data.size) return false;
    const most = Math.min(1, (0.08 * data.size) / size),
      ranges = actuators.map((one) => one.high - one.low);
    const ways =
      data.basis === null
        ? actuators.map((_, at) => actuators.map((__, one) => (one === at ? ranges[at] : 0)))
        : data.basis[0].map((_, k) => data.basis.map((row) => row[k] * Math.max(...ranges)));
    const moved = (steps) => wanted.motors.map((one, at) => one + ways.reduce((sum, way, k) => sum + steps[k] * way[at], 0));
    const columns = ways.map((_, k) => {
      const near = answer({ ...plain(wanted), motors: moved(ways.map((__, at) => (at === k ? 1e-4 : 0))) }, shown);
      return good(near) ? near.tip.map((one, axis) => (one - shown.tip[axis]) / 1e-4) : [0, 0, 0];
    });
    const square = [0, 1, 2].map((i) =>
      [0, 1, 2].map((j) => columns.reduce((sum, one) => sum + one[i] * one[j], i === j ? (0.1 * data.size) ** 2 : 0)),
    );
    const weights = solveSmall(
      square,
      error.map((one) => most * one),
    );
    const steps = columns.map((one) => one.reduce((sum, entry, axis) => sum + entry * weights[axis], 0));
    for (let share = 1; share > 0.05; share /= 2) {
      let motors = moved(steps.map((one) => share * one));
      if (data.basis === null)
        motors = motors.map((one, at) =>
          Math.max(actuators[at].lower ?? -Infinity, Math.min(actuators[at].upper ?? Infinity, one)),
        );
      else if (motors.some((one, at) => one < actuators[at].lower || one > actuators[at].upper)) continue;
      const found = answer({ ...plain(wanted), motors }, shown);
      if (good(found) && Math.hypot(...target.toArray().map((one, axis) => one - found.tip[axis])) < size) {
        wanted.motors = motors;
        return true;
      }
    }
    return false;
  }

  // Pointers and keys.
  const pointers = new Map();
  const local = (event) => {
    const box = $("canvas").getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  };
  const tip = $("tip"),
    canvas = $("canvas");
  tip.addEventListener("pointerdown", (event) => {
    if (!shown || event.button > 0) return;
    const [x, y] = local(event),
      [tx, ty] = scene.onScreen(scene.tip);
    dragging = { offset: [tx - x, ty - y], at: null, held: [...wanted.force] }; // the spring carries what is there
    try {
      tip.setPointerCapture(event.pointerId);
    } catch {
      /* a pointer that is no longer down */
    }
    tip.classList.add("dragged");
  });
  tip.addEventListener("pointermove", (event) => {
    if (!dragging) return;
    const [x, y] = local(event);
    dragging.at = [x + dragging.offset[0], y + dragging.offset[1]];
    scene.dirty = true;
  });
  const release = () => {
    dragging = null;
    tip.classList.remove("dragged");
    scene.stretch(null);
    keep();
  };
  for (const name of ["pointerup", "pointercancel", "lostpointercapture"]) tip.addEventListener(name, release);
  tip.addEventListener("keydown", (event) => {
    const ways = {
      ArrowRight: [0, 1],
      ArrowLeft: [0, -1],
      ArrowUp: [1, 1],
      ArrowDown: [1, -1],
      PageUp: [2, 1],
      PageDown: [2, -1],
    }[event.key];
    if (!ways || !shown) return;
    event.preventDefault();
    const along = scene.axes()[ways[0]].multiplyScalar(ways[1] * (event.shiftKey ? 0.1 : 1));
    if (mode() === "force")
      wanted.force = wanted.force.map((one, axis) => one + 0.1 * data.fullForce * along.getComponent(axis));
    else reach(scene.tip.clone().addScaledVector(along, 0.02 * data.size));
    refresh();
  });
  canvas.addEventListener("pointerdown", (event) => {
    pointers.set(event.pointerId, local(event));
    try {
      canvas.setPointerCapture(event.pointerId);
    } catch {
      /* as above */
    }
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

  // Buttons, and the state in the address.
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
    } catch (error) {
      console.warn(`the state in the address is not read: ${error.message}`);
    }
  }
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

  // The loop: solves when something is asked for, draws when something has changed.
  let last = 0,
    slow = 0;
  function frame(now) {
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
        [ax, ay] = scene.onScreen(scene.arrowEnd),
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
  return Object.defineProperties(
    window.softrobots,
    Object.getOwnPropertyDescriptors({
      robot: {
        name: data.name,
        actuators: actuators.map(({ name, unit, lower, upper, relaxed }) => ({ name, unit, lower, upper, relaxed })),
        springs: solver.springs,
      },
      solve: (given = {}) => answer({ motors: relaxed, ...input(given) }),
      set(given = {}) {
        show(given);
        asked = false;
        const found = solveShown();
        keep();
        return found;
      },
      view: scene,
      get shown() {
        return shown && { ...shownFor, tip: [...shown.tip], drawnTip: scene.handle.position.toArray(), failed };
      },
    }),
  );
}
