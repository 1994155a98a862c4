"""Checks of a robot description: its tags, the rules of portable URDF, and yourdfpy's kinematics against Pinocchio's."""

from __future__ import annotations

from pathlib import Path

import pinocchio as pin

from softrobots.cli.tools.kinematics import COUNT, PRECISION, PlacedLinks, as_file, compare_kinematics
from softrobots.core.errors import SoftRobotsError
from softrobots.description.sources import read_source
from softrobots.description.tag_reader import read_tags
from softrobots.description.urdf_rules import Finding, check_rules
from softrobots.model.loader import load_model
from softrobots.robots import Robot


def check_description(source: Robot | Path | str) -> tuple[Finding, ...]:
    """Check a robot description: what is in it, every rule of portable URDF, and how tools read it.

    Args:
        source: What `read_source` takes.

    Returns:
        What was checked and what is wrong with it, up to a defect that makes further checks impossible.

    Raises:
        SoftRobotsError: Whatever `read_source` raises.
    """
    urdf, label = read_source(source)
    rules = check_rules(urdf, label)
    findings = []
    for what, look in (("tags of softrobots", _tags), ("Pinocchio", _in_pinocchio), ("softrobots", _in_softrobots)):
        try:
            findings.append(Finding(what, (), (look(urdf, label),)))
        except (SoftRobotsError, ValueError, RuntimeError) as error:
            findings.append(Finding(what, (str(error),)))
    tags, *loaded = findings
    if not loaded[0].ok:
        return (tags, *rules, *loaded)
    return (tags, *rules, *loaded, _valid_in_yourdfpy(source), _kinematics(source))


def _kinematics(source: Robot | Path | str) -> Finding:
    """Compare yourdfpy's kinematics of every link with Pinocchio's."""
    try:
        row = compare_kinematics(source)
    except SoftRobotsError as error:
        return Finding("yourdfpy's kinematics", (str(error),))
    return Finding("yourdfpy's kinematics", tuple(row_problems(row)), (f"{_row_text(row)} at {COUNT} random configurations",))


def _row_text(row: PlacedLinks) -> str:
    """Return the errors of yourdfpy on one line."""
    errors = f"within {row.position_error:.1e} m and {row.rotation_error:.1e} rad of Pinocchio"
    return f"{errors}, {row.joints} of {row.joints_in_file} joints, {row.links} of {row.links + len(row.lost_links)} links"


def row_problems(row: PlacedLinks) -> list[str]:
    """Return what is wrong with a comparison; empty if yourdfpy agrees."""
    if row.problem:
        return [f"yourdfpy refuses the file: {row.problem}"]
    agrees = row.agrees_within(PRECISION)
    return [] if agrees else [f"yourdfpy is {_row_text(row)}; all of them within {PRECISION:g} are required"]


def _tags(urdf: str, label: str) -> str:
    tags = read_tags(urdf, label)
    parts = {
        "motors": list(tags.roles.values()).count("motor"),
        "springs": len(tags.springs),
        "inflated links": len(tags.inflated_links),
        "sections": len(tags.sections),
        "lumped sections": len(tags.lumped_sections),
        "muscles": len(tags.muscles),
        "capsules": len(tags.capsules),
    }
    return ", ".join(f"{count} {what}" for what, count in parts.items() if count) or "none"


def _in_pinocchio(urdf: str, label: str) -> str:
    model = pin.buildModelFromXML(urdf)
    moving = sum(inertia.mass for inertia in list(model.inertias)[1:])
    return f"{model.njoints - 1} movable joints, {moving:.6g} kg that move"


def _in_softrobots(urdf: str, label: str) -> str:
    tags = read_tags(urdf, label)
    if not tags.springs and not tags.sections:
        return "no springs; load_model needs springs={joint: stiffness}"
    model = load_model(urdf)
    return f"loads: {model.n_motors} motors, {model.n_springs} elastic coordinates, tip {model.tip}"


def _valid_in_yourdfpy(source: Robot | Path | str) -> Finding:
    import yourdfpy

    with as_file(source) as (file, _):
        try:
            robot = yourdfpy.URDF.load(str(file), load_meshes=False, build_collision_scene_graph=False)
            robot.validate()
        except Exception as error:  # yourdfpy raises what its parser raises
            return Finding("yourdfpy", (f"refuses the file: {type(error).__name__}: {error}",))
    return Finding("yourdfpy", tuple(str(error) for error in robot.errors), (f"valid, {len(robot.link_map)} links",))
