"""Serialisation of contact paths: named arrays for result files, and columns of CSV tables.

A file holds robots, loads, coordinates and the forces of the contacts. Everything else is computed again on loading; rows that
are not in balance, or whose forces are outside of the cone of friction, are refused.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray, choice, finite_array, finite_number, increasing, non_negative_number, read_only
from softrobots.core.errors import FileFormatError
from softrobots.core.json_text import parse_json
from softrobots.core.result_file import KINDS, Kind, counts, label
from softrobots.environment.environment import check_environment
from softrobots.environment.gaps import Surroundings
from softrobots.model.soft_model import SoftModel
from softrobots.statics.contact.contact import PRESSED, SLIPS, STICKS, Contact
from softrobots.statics.contact.contact_path import LOST, MADE, ContactEvent, ContactJump, ContactPath
from softrobots.statics.contact.coulomb import balance_of
from softrobots.statics.contact.last_state import MARGIN, Given, Sliding
from softrobots.statics.contact.sliding import SlidingRobot
from softrobots.statics.equilibrium_result import Equilibrium
from softrobots.statics.loads import load_of_data
from softrobots.statics.saved_results import pack_model, unpack_model

_SAME = 1e-7  # distance of points that are one, and gap of a contact that presses, relative to the reach


def _pack(path: ContactPath) -> dict[str, Any]:
    rows = [*path.equilibria, *(row for jump in path.jumps for row in (jump.before, jump.after))]
    packed = [pack_model(row.model, row.load) for row in rows]
    robots = list(dict.fromkeys((one["urdf"], one["model"]) for one in packed))
    pressed = [[one for one in row.contacts if one.strict] for row in rows]
    contacts = [one for row in pressed for one in row]
    return {
        "urdf": [urdf for urdf, _ in robots],
        "model": [model for _, model in robots],
        "robot": [robots.index((one["urdf"], one["model"])) for one in packed],
        "loads": [one["load"] for one in packed],
        "q_motors": [row.q_motors for row in rows],
        "q_springs": np.concatenate([row.q_springs for row in rows]),
        "residual": [row.residual for row in rows],
        "iterations": [row.iterations for row in rows],
        "n_contacts": [len(row) for row in pressed],
        **{name: np.array([getattr(one, name) for one in contacts]).reshape(-1, 3) for name in ("point", "force", "slip")},
        "status": np.array([one.status for one in contacts], dtype=np.str_),
        "parameters": path.parameters,
        "friction": path.friction,
        "dissipation": path.dissipation,
        "ended": path.ended,
        "event_parameters": np.array([one.parameter for one in path.events]),
        "events": np.array([(one.kind, one.link, one.obstacle) for one in path.events], dtype=np.str_).reshape(-1, 3),
        "jump_parameters": np.array([one.parameter for one in path.jumps]),
        "energy_lost": np.array([one.energy_lost for one in path.jumps]),
    }


def _unpack(fields: Mapping[str, Any]) -> ContactPath:
    friction = non_negative_number("friction", fields["friction"].item())
    rows = _unpack_rows(fields, friction)
    parameters = increasing("parameters", finite_array("parameters", fields["parameters"], (None,)), "")
    dissipation = finite_array("dissipation", fields["dissipation"], parameters.shape, "J")
    places, lost = (finite_array(name, fields[name], (None,)) for name in ("jump_parameters", "energy_lost"))
    n = len(parameters)
    if (
        not 0 < n == len(rows) - 2 * len(places)
        or places.shape != lost.shape
        or len(fields["event_parameters"]) != len(fields["events"])
    ):
        raise FileFormatError("its arrays must have one row a parameter, an event, and two rows a jump")
    events = []
    for parameter, words in zip(fields["event_parameters"].tolist(), fields["events"], strict=True):
        kind, link, obstacle = (label({"events": word}, "events") for word in words)
        kind = choice("events", kind, (MADE, LOST, SLIPS, STICKS))
        events.append(ContactEvent(finite_number("event_parameters", parameter), kind, link, obstacle))
    pairs = zip(places.tolist(), rows[n::2], rows[n + 1 :: 2], lost.tolist(), strict=True)
    return ContactPath(
        parameters=read_only(parameters),
        equilibria=rows[:n],
        friction=friction,
        dissipation=read_only(dissipation),
        events=tuple(events),
        jumps=tuple(ContactJump(*jump) for jump in pairs),
        ended="" if str(fields["ended"]) == "" else label(fields, "ended"),
    )


def _unpack_rows(fields: Mapping[str, Any], friction: float) -> tuple[Equilibrium, ...]:
    words = zip(fields["urdf"], fields["model"], strict=True)
    first = np.atleast_1d(fields["loads"])[0]
    models = [unpack_model({"urdf": urdf, "model": model, "load": first})[0] for urdf, model in words]
    robots, sizes, iterations = (counts(fields, name) for name in ("robot", "n_contacts", "iterations"))
    residual = finite_array("residual", fields["residual"], (len(robots),), "N m")
    motors = finite_array("q_motors", fields["q_motors"], (len(robots), models[0].n_motors))
    springs = finite_array("q_springs", fields["q_springs"], (sum(models[robot].n_springs for robot in robots),))
    points, forces, slips = (finite_array(name, fields[name], (sum(sizes), 3)) for name in ("point", "force", "slip"))
    statuses = [choice("status", str(one), (PRESSED, STICKS, SLIPS)) for one in fields["status"]]
    rows, used, touched = [], 0, 0
    for number, (robot, size) in enumerate(zip(robots, sizes, strict=True)):
        model, chosen = models[robot], slice(touched, touched + size)
        load = load_of_data(model, parse_json(str(fields["loads"][number])))
        environment = check_environment(load.environment)
        given = Given(model, model.actuators.checked(motors[number]), load, environment, Surroundings(model, environment))
        own = springs[used : used + model.n_springs]
        row = _state(given, own, friction, points[chosen], forces[chosen], statuses[chosen], iterations[number])
        if not row.residual <= 1.001 * residual[number] + 1e-2 * row.tolerance:
            raise FileFormatError(
                f"its row {number} claims a residual of {residual[number]:.3g} N m, but it is {row.residual:.3g} N m"
            )
        rows.append(replace(row, contacts=_with_slips(row.contacts, statuses[chosen], slips[chosen])))
        used, touched = used + model.n_springs, touched + size
    return tuple(rows)


def _state(
    given: Given,
    springs: FloatArray,
    friction: float,
    points: FloatArray,
    forces: FloatArray,
    statuses: list[str],
    iterations: int,
) -> Equilibrium:
    """Equilibrium at given coordinates with given forces of contacts.

    Raises:
        FileFormatError: If it cannot be one.
    """
    model = given.model
    point = model.coordinates.at(given.q_motors, springs)
    if not point.valid:
        raise FileFormatError("a section of its robot is out of range")
    gaps = given.surroundings.at(model.embed(point.joints), MARGIN * model.reach)
    robot = SlidingRobot(given, Sliding(friction, gaps))
    near = robot.contacts(springs)
    places = [int(np.linalg.norm(gaps.points - one, axis=1).argmin()) for one in points] if len(gaps) else []
    normal, along, sticks = np.zeros(len(gaps)), np.zeros((len(gaps), 2)), np.zeros(len(gaps), dtype=bool)
    apart = np.linalg.norm(gaps.points[places] - points, axis=1) if len(places) == len(points) else np.full(1, np.inf)
    normal[places] = np.einsum("mi,mi->m", forces, gaps.normals[places])
    along[places] = np.einsum("mki,mi->mk", robot.at.tangents[places], forces)
    sticks[places] = [status == STICKS for status in statuses]
    closed = max(apart.max(initial=0.0), np.abs(gaps.values[places]).max(initial=0.0), -gaps.values.min(initial=0.0))
    cone = np.linalg.norm(along, axis=1) - friction * normal
    if near is None or closed > _SAME * model.reach or len(set(places)) < len(points):
        raise FileFormatError("its contacts are not where its robot touches")
    if normal.min(initial=0.0) < 0.0 or cone.max(initial=0.0) > _SAME * normal.max(initial=0.0):
        raise FileFormatError("its forces are outside of the cone of friction")
    return robot.equilibrium(balance_of(robot, springs, near, normal, along, sticks), iterations)


def _with_slips(contacts: tuple[Contact, ...], statuses: list[str], slips: FloatArray) -> tuple[Contact, ...]:
    """Contacts with what is known of the step in which they were found; those that press are in the order of the file."""
    of_pressed = iter(zip(statuses, slips, strict=True))
    pairs = [(one, next(of_pressed, None) if one.strict else None) for one in contacts]
    return tuple(one if known is None else replace(one, status=known[0], slip=known[1].copy()) for one, known in pairs)


def _table(path: ContactPath) -> dict[str, FloatArray]:
    """Columns of a CSV file of a contact path; see `save_csv`."""
    columns = {"parameter": path.parameters, "dissipation_J": path.dissipation}
    for name, vectors, unit in (("tip", path.tip_positions, "m"), ("force", path.forces, "N")):
        columns |= {f"{name}_{axis}_{unit}": column for axis, column in zip("xyz", vectors.T, strict=True)}
    columns["contacts"] = np.array([sum(one.strict for one in row) for row in path.contacts], dtype=np.float64)
    model: SoftModel = path.model
    rows = [(*row.q_motors, *row.q_springs) for row in path.equilibria]
    if all(row.model == model for row in path.equilibria):
        names = (f"joint_{name}" for name in (*model.motor_joints, *model.spring_joints))
        columns |= dict(zip(names, np.array(rows).T, strict=True))
    return columns


KINDS["contact_path"] = Kind(ContactPath, _pack, _unpack, many=True, to_table=_table)
