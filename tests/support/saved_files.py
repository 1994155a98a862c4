"""Saved results compared field by field, and changed."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

import softrobots as sr


def same(one: object, other: object, path: str = "") -> None:
    """Compare two results field by field; arrays to the last bit, the model by its URDF and springs."""
    assert type(one) is type(other), path
    if isinstance(one, sr.SoftModel):
        assert (one.urdf, one.spring_table, one.motor_joints, one.tip) == (
            other.urdf, other.spring_table, other.motor_joints, other.tip,
        )  # fmt: skip
    elif isinstance(one, np.ndarray):
        assert np.array_equal(one, other), path
    elif isinstance(one, tuple):
        assert len(one) == len(other)
        for number, (a, b) in enumerate(zip(one, other, strict=True)):
            same(a, b, f"{path}[{number}]")
    elif isinstance(one, Mapping):
        assert one.keys() == other.keys()
        for key in one:
            same(one[key], other[key], f"{path}[{key}]")
    elif hasattr(one, "__dataclass_fields__"):
        for name in one.__dataclass_fields__:
            same(getattr(one, name), getattr(other, name), f"{path}.{name}")
    else:
        assert one == other, path


def altered(file: Path, target: Path, **changes: np.ndarray) -> Path:
    """Copy a result file with other arrays."""
    with np.load(file) as data:
        fields = dict(data) | changes
    np.savez(target, **fields)
    return target
