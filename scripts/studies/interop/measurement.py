"""Equilibria and link poses of every installed tool against Pinocchio."""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Sequence
from typing import Any

from tqdm import tqdm

import softrobots as sr
from softrobots.description.paths import urdf_folder
from softrobots.export import to_mjcf, to_sdf
from studies.interop.cases import WELDED, equilibrium_cases
from studies.interop.kinematics import compare_tools
from studies.interop.simulators import SIMULATORS, compare_equilibrium
from studies.interop.springs_read import FORMATS, springs_read
from studies.interop.tools import TOOLS

ROBOTS = {"inflatable_arm": "inflatable arm", "pcc_arm_lumped": "arm of muscles", "helix_tube_lumped": "helical tube"}
"""Robots of the equilibria, and what the tables call them."""
POSES = 5
Results = dict[str, Any]
"""What is written as JSON: "springs", "equilibrium" and "kinematics", each a list with a dictionary a case."""


def measure(arguments: argparse.Namespace) -> Results:
    """Ask the tools."""
    missing = [name for name in arguments.tools or () if TOOLS[name].version is None]
    if missing:
        raise sr.MissingDependency(TOOLS[missing[0]].package, TOOLS[missing[0]].extra)
    tools = arguments.tools or [name for name, tool in TOOLS.items() if tool.version is not None]
    simulators = [name for name in SIMULATORS if name in tools]
    if arguments.equilibrium_only and not simulators:
        requirement = f"tools with one of {', '.join(SIMULATORS)} among them: the others have no statics"
        raise sr.ParameterError("--tools", tools, requirement)
    if arguments.kinematics_only and (arguments.no_simulation or arguments.poses != POSES or arguments.robots != list(ROBOTS)):
        raise sr.ParameterError("--kinematics-only", True, "given without --robots, --poses and --no-simulation")
    results: Results = {"springs": [], "equilibrium": [], "kinematics": []}
    if not arguments.kinematics_only:
        results["springs"] = arriving_springs(simulators, arguments.robots)
        cases = [(case, tool) for case in equilibrium_cases(arguments.robots, arguments.poses) for tool in simulators]
        with tqdm(cases, desc="equilibria", unit="case") as bar:
            for case, tool in bar:
                bar.set_postfix_str(f"{tool}, {case.name}")
                row = compare_equilibrium(case, tool, simulated=not arguments.no_simulation)
                results["equilibrium"].append(dataclasses.asdict(row) | {"agrees": row.agrees})
    if not arguments.equilibrium_only:
        for file in tqdm(sorted(urdf_folder().glob("*.urdf")), desc="kinematics", unit="file"):
            rows = compare_tools(file, tools)
            results["kinematics"] += [dataclasses.asdict(row) | {"agrees": row.agrees} for row in rows]
    return results


def arriving_springs(tools: Sequence[str], robots: Sequence[str]) -> list[dict[str, Any]]:
    """How many joint springs of each file arrive in each tool."""
    result = []
    for case in equilibrium_cases(robots, 1):
        if case.gravity is not None:
            continue
        texts = {
            "URDF": case.model.urdf,
            "MJCF": to_mjcf(case.model, case.expected.q_motors, actuators=WELDED),
            "SDF": to_sdf(case.model, case.expected.q_motors, actuators=WELDED),
        }
        for tool in tools:
            for name in FORMATS:
                read = springs_read(tool, texts[name], name)
                result.append(
                    {"tool": tool, "robot": case.robot, "format": name, "read": read, "of": len(case.model.spring_table)}
                )
    return result


def agreed(results: Results) -> bool:
    """Whether every tool agrees."""
    return all(row["agrees"] for row in (*results["equilibrium"], *results["kinematics"]))
