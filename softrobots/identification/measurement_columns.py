"""Which columns of a table hold which measurements, in which units."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import chain
from typing import Any, NamedTuple

import numpy as np

from softrobots.core.bounded_reading import read_text
from softrobots.core.checks import FloatArray, finite_array, instance_of
from softrobots.core.errors import FileFormatError, NameNotFound, ParameterError
from softrobots.core.files import as_path
from softrobots.core.json_text import parse_json
from softrobots.core.units import UNITS
from softrobots.core.yaml_text import parse_yaml
from softrobots.robots.parameter_file import LARGEST_FILE

ROTATIONS = {"matrix": 9, "quaternion": 4, "roll_pitch_yaw": 3, "rotation_vector": 3}
"""Forms of the rotation of a pose, with their number of columns: rows of a matrix; w, x, y, z; fixed axes; axis times angle."""


class Quantity(NamedTuple):
    """What the columns of one entry of a mapping may hold."""

    kinds: tuple[str, ...]
    """Keys of `UNITS`."""
    width: int | None = None
    """Number of columns; None: any."""
    named: bool = False
    """Whether there is one entry for each of several frames or markers."""
    measured: bool = False
    """Whether it is measured: cells may be missing, and it may have standard deviations."""


QUANTITIES = {
    "actuators": Quantity(("angle", "length", "force", "pressure")),
    "force": Quantity(("force",), 3),
    "wrench": Quantity(("force", "torque"), 6, named=True),
    "mass": Quantity(("mass",), 1),
    "gravity": Quantity(("acceleration",), 3),
    "positions": Quantity(("length",), 3, named=True, measured=True),
    "poses": Quantity(("length",), 3, named=True, measured=True),
    "motor_torques": Quantity(("torque", "force"), measured=True),
    "tensions": Quantity(("force",), measured=True),
    "frequencies": Quantity(("frequency",), measured=True),
    "damping_ratios": Quantity(("ratio",), measured=True),
}
"""Entries of a mapping that have columns of numbers."""


class Group(NamedTuple):
    """Columns that make one array."""

    quantity: str
    """Key of `QUANTITIES`."""
    name: str
    """Frame or marker, or empty."""
    columns: tuple[str, ...]
    """Names of the columns; of a pose those of the rotation follow."""
    factors: FloatArray
    """What converts them, shape (n_columns,)."""
    rotation: str
    """Form of the rotation of a pose, of `ROTATIONS`, or empty."""
    std: tuple[str | float, ...]
    """Standard deviation of each component, or the columns that hold them; empty if unknown."""
    std_factors: FloatArray
    """What converts those."""


class Layout(NamedTuple):
    """A mapping that has been checked."""

    groups: tuple[Group, ...]
    """Columns of numbers."""
    constants: dict[str, Any]
    """Arguments of `Measurements` that are the same for all rows."""
    labels: tuple[str, str] | None
    """Column of the labels, and an ending that is taken off."""
    mask: str | None
    """Column that holds 1 in rows that count, else 0."""

    @property
    def gaps(self) -> set[str]:
        """Columns whose cells may be missing."""
        measured = (group for group in self.groups if QUANTITIES[group.quantity].measured)
        return {one for group in measured for one in (*group.columns, *group.std) if isinstance(one, str)}

    @property
    def numbers(self) -> tuple[str, ...]:
        """Every column of numbers, once."""
        columns = chain.from_iterable((*group.columns, *group.std) for group in self.groups)
        return tuple(dict.fromkeys(one for one in (*columns, self.mask) if isinstance(one, str)))

    def arguments(self, numbers: Callable[[str], FloatArray], words: Callable[[str], Sequence[str]]) -> dict[str, Any]:
        """Return the arguments of `Measurements` from functions that return a column of a table."""
        found: dict[str, Any] = dict(self.constants)
        std: dict[str, FloatArray] = {}
        for group in self.groups:
            none = np.zeros((len(numbers(self.numbers[0])) if self.numbers else 0, 0))  # a robot without actuators
            values = np.column_stack([none, *map(numbers, group.columns)]) * group.factors
            if group.rotation:
                values = _poses(values[:, :3], values[:, 3:], group.rotation)
            if group.std:
                rows = [numbers(one) if isinstance(one, str) else np.full(len(values), float(one)) for one in group.std]
                std[f"{group.quantity}.{group.name}".rstrip(".")] = np.column_stack(rows) * group.std_factors
            if group.name:
                found.setdefault(group.quantity, {})[group.name] = values
            else:
                found["q_motors" if group.quantity == "actuators" else group.quantity] = values
        if "mass" in found:
            found["mass"] = found["mass"][:, 0]
        if self.labels is not None:
            found["labels"] = [word.removesuffix(self.labels[1]) for word in words(self.labels[0])]
        if self.mask is not None:
            mask = numbers(self.mask)
            if not np.all(np.isin(mask, (0.0, 1.0))):
                raise ParameterError("mask", mask, "0 or 1 in every row")
            found["mask"] = mask == 1.0
        return found | {"std": std or None}


def read_columns(columns: Any) -> Layout:
    """Check a mapping of columns, as a dictionary or a YAML or JSON file.

        actuators: {columns: [servo_4_mm, servo_3_mm, servo_9_mm], unit: mm, relative: true}  # names: [...] in any order
        gravity: [0, 0, -9.81]                                            # m/s^2; or columns and a unit
        mass: {columns: hung_g, unit: g}
        positions: {tip: {columns: [tip_x, tip_y, tip_z], unit: mm, std: 1.0}}
        poses: {elbow: {columns: [x, y, z], unit: m, quaternion: [qw, qx, qy, qz], std: [0.001, 0.01]}}
        motor_torques: {columns: [t_1, t_2, t_3], unit: [N m, N m, N], std: [std_1, std_2, std_3]}
        labels: {column: pattern, without_suffix: _hold}

    `unit` is one for all columns, or one for each equal share of them; "SI" converts nothing. `scale` multiplies afterwards,
    e.g. -1 for an axis that is mirrored, or the radius of a pulley. `std` has the unit of the columns: a number or the name of
    a column, one for all or one each; of poses two, position and angle. The rotation of a pose is one of `ROTATIONS`, angles
    in `angle_unit` (rad). `force`, `wrench`, `tensions`, `frequencies`, `damping_ratios`, `mask` and `markers` are those of
    `Measurements`.

    Args:
        columns: The mapping, or the path of a YAML file (JSON if its name ends with `.json`) that holds it.

    Raises:
        ParameterError: If an entry has another form, or a unit is none of its quantity.
        NameNotFound: If a key is unknown.
        FileFormatError: If the file cannot be read, or holds such a mapping.
    """
    if isinstance(columns, Mapping):
        return _layout(columns)
    path = as_path("columns", columns)
    try:
        text = read_text(path, LARGEST_FILE)
        return _layout(parse_json(text) if path.suffix.lower() == ".json" else parse_yaml(text))
    except (ParameterError, NameNotFound, FileFormatError) as error:
        raise FileFormatError(f"cannot read columns from {path}: {error}") from error


def _layout(columns: Any) -> Layout:
    entry = _entry("columns", columns, ("labels", "mask", "markers", *QUANTITIES))
    groups: list[Group] = []
    constants: dict[str, Any] = {}
    for key, quantity in QUANTITIES.items():
        value, where = entry.get(key), f"columns.{key}"
        if key == "gravity" and isinstance(value, list | tuple):
            constants["gravity"] = finite_array(where, value, (3,), "m/s^2")
        elif value is not None and quantity.named:
            groups += [_group(f"{where}.{name}", key, name, one) for name, one in _entry(where, value).items()]
        elif value is not None:
            groups.append(_group(where, key, "", value))
    if entry.get("actuators") is None:
        raise ParameterError("columns", list(entry), "a mapping with the entry 'actuators'")
    relative = entry["actuators"].get("relative", False)
    constants["relative"] = instance_of("columns.actuators.relative", relative, bool, "true or false")
    if entry["actuators"].get("names") is not None:
        constants["actuators"] = entry["actuators"]["names"]
    if entry.get("markers") is not None:
        constants["markers"] = _entry("columns.markers", entry["markers"])
    labels = entry.get("labels")
    if labels is not None:
        labels = _entry(
            "columns.labels", {"column": labels} if isinstance(labels, str) else labels, ("column", "without_suffix")
        )
        labels = (_words("columns.labels.column", labels.get("column"), 1)[0], str(labels.get("without_suffix", "")))
    mask = entry.get("mask")
    return Layout(tuple(groups), constants, labels, None if mask is None else _words("columns.mask", mask, 1)[0])


def _group(where: str, key: str, name: str, value: Any) -> Group:
    """One entry with columns of numbers."""
    quantity, pose = QUANTITIES[key], key == "poses"
    keys = [
        "columns",
        "unit",
        "scale",
        *(["std"] if quantity.measured else []),
        *(["relative", "names"] if key == "actuators" else []),
    ]
    entry = _entry(where, value, (*keys, *(("angle_unit", *ROTATIONS) if pose else ())))
    none = key == "actuators" and entry.get("columns") == []
    columns = () if none else _words(f"{where}.columns", entry.get("columns"), quantity.width)
    units = _units(f"{where}.unit", entry.get("unit"), quantity.kinds, len(columns))
    scale = finite_array(f"{where}.scale", entry.get("scale", 1.0), None)
    if scale.shape not in ((), (len(columns),)) or np.any(scale == 0.0):
        raise ParameterError(f"{where}.scale", entry["scale"], "one number different from zero, or one for each column")
    factors, rotation, angle = units * scale, "", 1.0
    if pose:
        forms = [form for form in ROTATIONS if form in entry]
        if len(forms) != 1:
            raise ParameterError(where, list(entry), f"a mapping with one of {', '.join(ROTATIONS)}")
        rotation = forms[0]
        columns += _words(f"{where}.{rotation}", entry[rotation], ROTATIONS[rotation])
        angle = float(_units(f"{where}.angle_unit", entry.get("angle_unit", "rad"), ("angle",), 1)[0])
        turn = angle if rotation in ("roll_pitch_yaw", "rotation_vector") else 1.0
        factors = np.append(factors, np.full(ROTATIONS[rotation], turn))
    given = entry.get("std", [])
    std = tuple(given) if isinstance(given, list | tuple) else (given,)
    size, few = (6, 2) if pose else (len(columns), 1)
    if len(std) not in (0, few, size) or any(isinstance(one, bool) or not isinstance(one, str | int | float) for one in std):
        requirement = (
            f"a number or the name of a column, {few} or {size} of them" if pose else f"a number or column, one or {size}"
        )
        raise ParameterError(f"{where}.std", given, requirement)
    std = tuple(one for one in std for _ in range(size // len(std)))
    each = np.append(factors[:3], np.full(3, angle)) if pose else factors
    return Group(key, name, columns, factors, rotation, std, np.abs(each))


def _entry(where: str, value: Any, keys: Sequence[str] = ()) -> dict[str, Any]:
    """A mapping with no other keys than these, if any are given."""
    mapping: Mapping[str, Any] = instance_of(where, value, Mapping, "a mapping")  # type: ignore[type-abstract]
    unknown = next((key for key in mapping if not isinstance(key, str) or (keys and key not in keys)), None)
    if unknown is not None:
        raise NameNotFound(f"entry of {where}", str(unknown), keys)
    return dict(mapping)


def _words(where: str, value: Any, count: int | None) -> tuple[str, ...]:
    """Names of columns; a word stands for a list of one."""
    words = [value] if isinstance(value, str) else value
    fits = isinstance(words, list | tuple) and len(words) == (count or max(len(words), 1))
    if not fits or not all(isinstance(word, str) and word for word in words) or len(set(words)) < len(words):
        raise ParameterError(where, value, f"names of {count or 'one or more'} columns, each once")
    return tuple(words)


def _units(where: str, value: Any, kinds: Sequence[str], count: int) -> FloatArray:
    """Factors of units, one for all columns or one for each equal share of them, shape (count,)."""
    known = {"SI": 1.0} | dict(chain.from_iterable(UNITS[kind].items() for kind in kinds))
    units = list(value) if isinstance(value, list | tuple) else [value]
    if not units or count % len(units) or not all(isinstance(unit, str) and unit in known for unit in units):
        raise ParameterError(where, value, f"one unit, or one for each column, of {', '.join(known)}")
    return np.repeat([known[unit] for unit in units], count // len(units))


def _poses(positions: FloatArray, rotations: FloatArray, form: str) -> FloatArray:
    """Homogeneous matrices, shape (n, 4, 4), missing where a cell is."""
    from scipy.spatial.transform import Rotation

    poses = np.tile(np.eye(4), (len(positions), 1, 1))
    poses[:, :3, 3], poses[:, :3, :3] = positions, np.nan
    known = ~np.isnan(rotations).any(axis=1)
    if form == "matrix":
        poses[known, :3, :3] = rotations[known].reshape(-1, 3, 3)
    elif form == "roll_pitch_yaw":
        poses[known, :3, :3] = Rotation.from_euler("xyz", rotations[known]).as_matrix()
    elif form == "rotation_vector":
        poses[known, :3, :3] = Rotation.from_rotvec(rotations[known]).as_matrix()
    else:
        norms = np.linalg.norm(rotations[known], axis=1)
        if np.any(np.abs(norms - 1.0) > 0.01):
            raise ParameterError("quaternion", norms[int(np.argmax(np.abs(norms - 1.0)))], "of length one, within 0.01")
        poses[known, :3, :3] = Rotation.from_quat(rotations[known][:, [1, 2, 3, 0]]).as_matrix()
    return poses
