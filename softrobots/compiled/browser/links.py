"""What a page needs to know of the inflated links of a robot, for `softrobots.model.link_limits` in `solver.js`."""

from __future__ import annotations

from typing import Any

import numpy as np

from softrobots.constant_curvature.strain_chain import STRAINS
from softrobots.model.serial_chain import ChainJoint, ChainSection, SerialChain, bodies_of
from softrobots.model.soft_model import SoftModel


def inflated_links(model: SoftModel, chain: SerialChain, frames: list[dict[str, object]]) -> list[dict[str, Any]]:
    """Return each inflated link, with its hinges; strains are places in the chain, joints places in `frames`."""
    places = {frame["name"]: place for place, frame in enumerate(frames)}
    of_section = {
        f"{one.name}_{name}": (one.name, one.strain + row)
        for one in chain.elements
        if isinstance(one, ChainSection)
        for row, name in enumerate(STRAINS)
    }
    joints = {one.name: (row, one) for row, one in enumerate(chain.elements) if isinstance(one, ChainJoint)}
    links = []
    for number, group in enumerate(model.spring_groups, start=1):
        names = [[model.spring_joints[place] for place in hinge] for hinge in group.hinges]
        name = f"{'link' if group.segment is None else 'section'} {number}"
        link: dict[str, Any] = {"name": name, "pressure": group.pressure, "radius": group.radius, "segment": group.segment}
        if names[0][0] in of_section:
            section = of_section[names[0][0]][0]
            link |= {"strains": [[of_section[one][1] for one in hinge] for hinge in names]}
            link |= {"hinges": None, "stretch": of_section[f"{section}_stretch"][1]}
        else:
            link |= {"strains": [[joints[one][1].strain for one in hinge] for hinge in names], "stretch": None}
            link["hinges"] = [_hinge(chain, sorted(joints[one][0] for one in hinge), places) for hinge in names]
        links.append(link)
    return links


def _hinge(chain: SerialChain, rows: list[int], places: dict[object, int]) -> dict[str, Any]:
    """Return the first and the last spring of a hinge, and the mass that they carry [kg]."""
    inner, outer = (joint for joint in (chain.elements[rows[0]], chain.elements[rows[-1]]) if isinstance(joint, ChainJoint))
    own = sum(body.mass for body in bodies_of(outer))
    return {
        "mass": chain.masses_beyond[rows[-1]] + own,
        "before": -1 if rows[0] == 0 else places[chain.elements[rows[0] - 1].name],
        "joints": [
            {"frame": places[one.name], "axis": one.axes[:, 2].tolist(), "strain": one.strain} for one in (inner, outer)
        ],
        "lever": (outer.axes @ np.asarray(outer.body.first_moment)).tolist(),
    }
