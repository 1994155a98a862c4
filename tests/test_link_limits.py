"""Axial forces in inflated links by free bodies, and the limits of their walls with them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import softrobots as sr
from softrobots.view.scene import WRINKLING_COLOURS, wrinkling_level
from tests.support.free_bodies import bisector, force_beyond
from tests.support.laws import law
from tests.support.tables import each_row

RADIUS, CAP = 0.055, 50e3 * math.pi * 0.055**2


@law("LinkLimits")
@given(st.integers(0, 2**32 - 1))
@settings(max_examples=15)
def test_the_axial_force_is_that_on_the_free_body_beyond_the_hinge(seed: int) -> None:
    """Forces at several links and weight, in any posture; along the axis halfway between both sides of the hinge."""
    model = ARMS[seed % 3]
    random = np.random.default_rng(seed)
    wrenches = {name: np.r_[random.normal(0.0, 6.0, 3), np.zeros(3)] for name in ("link_1", "link_2_root", "tip")}
    gravity = random.normal(0.0, 6.0, 3) if seed % 2 else None
    found = sr.solve_equilibrium(model, random.uniform(-2.0, 2.0, 3), wrench=wrenches, gravity=gravity)
    limits = found.link_limits
    assert isinstance(limits, sr.LinkLimits)
    cuts = [("root", ""), ("root", "")] if model.n_springs == 4 else [("root", "middle"), ("middle", "")]
    for link in (1, 2):
        by_hinge = []
        for place, (before, behind) in enumerate(cuts if model.n_springs != 4 else cuts[:1]):
            force = force_beyond(model.urdf, "_".join(filter(None, (f"link_{link}", behind))), wrenches, gravity)
            axial = float(force @ bisector(model, found, link, before, behind))
            hinge = model.spring_groups[link - 1].hinges[place]
            moment = float(np.linalg.norm(found.spring_torques[list(hinge)]))
            tension = CAP + axial
            by_hinge.append((1.0 - moment / (math.pi / 4.0 * tension * RADIUS), moment, axial, tension))
        margin, moment, axial, tension = min(by_hinge)
        assert limits.axial_forces[link - 1] == pytest.approx(axial, abs=1e-9)
        assert limits.moments[link - 1] == pytest.approx(moment, rel=1e-12)
        assert limits.wrinkling_margins[link - 1] == pytest.approx(margin, abs=1e-12)
        assert limits.slack_margins[link - 1] == pytest.approx(1.0 - moment / (0.5 * tension * RADIUS), abs=1e-12)
        needed = max((4.0 * m / (math.pi * RADIUS) - n) / (math.pi * RADIUS**2) for _, m, n, _ in by_hinge)
        assert limits.required_pressures[link - 1] == pytest.approx(max(needed, 0.0), rel=1e-9)
    assert found.wrinkled == bool((limits.wrinkling_margins <= 0.0).any())


ARMS = [
    sr.load_model(sr.InflatableArm(rest_up=(0.05, -0.1))),
    sr.load_model(sr.InflatableArm(moment_law="slack_wall")),
    sr.load_model(sr.InflatableArm(link_model="two_hinges")),
]


def test_a_push_takes_its_share_of_the_cap_force() -> None:
    """114 N of 475 N, 24 %: a moment between both limits wrinkles the link that is pushed, and not the one that is not."""
    model = sr.load_model(sr.InflatableArm(link_lengths=(0.6,)))
    moment = 0.88 * math.pi / 4.0 * CAP * RADIUS
    bent = sr.solve_equilibrium(model, (0.0, 0.0), (0.0, 0.0, -moment / 0.57))
    assert not bent.wrinkled
    assert wrinkling_level(bent, 0) < len(WRINKLING_COLOURS) - 1
    lever = 0.57 * float(np.sin(0.1))
    pushed = sr.solve_equilibrium(model, (0.0, 0.0), (-114.0, 0.0, -(moment - 114.0 * lever) / 0.57))
    assert pushed.link_moments[0] < model.spring_groups[0].wrinkling_moment  # that without axial force
    assert pushed.wrinkled
    assert wrinkling_level(pushed, 0) == len(WRINKLING_COLOURS) - 1


def test_more_push_than_the_cap_force_leaves_no_wall() -> None:
    """Nothing but the pressure carries compression: no moment is left, and more pressure is needed even without one."""
    model = sr.load_model(sr.InflatableArm(pressure=5e3))  # a cap force of 47.5 N
    limits = sr.solve_equilibrium(model, (0.0, 0.0, 0.0), (-60.0, 0.0, 0.0)).link_limits
    assert limits.wrinkling_moments.tolist() == limits.slack_moments.tolist() == [0.0, 0.0]
    assert limits.wrinkling_margins.tolist() == limits.slack_margins.tolist() == [-math.inf, -math.inf]
    assert limits.required_pressures == pytest.approx([60.0 / (math.pi * RADIUS**2)] * 2, rel=1e-12)


def with_links(robot: sr.PccArm) -> str:
    """A PCC arm whose sections are inflated links."""
    text, muscled = robot.urdf(), sr.load_model(robot, muscles="forces")
    names = [row.name for row in muscled.structure.section_table]
    tag = '<softrobots:inflated_link springs="{0}_bend_x {0}_bend_y" radius="0.03" pressure="2e4"/>'
    return text.replace("</robot>", "".join(tag.format(name) for name in names) + "</robot>")


@each_row("chain", ["lumped", "sections"])
def test_muscles_take_tension_from_the_wall(chain: str) -> None:
    """A straight arm is stretched by the load less the tensions: EA (stretch - 1), from the shape of each section."""
    robot = sr.PccArm(chain=chain, **({"extension": True} if chain == "lumped" else {}))
    model = sr.load_model(with_links(robot), muscles="forces")
    tensions = np.full(len(model.muscles), 3.0)
    tensions[: len(tensions) // 2] = 2.0
    found = sr.solve_equilibrium(model, tensions, (0.0, 0.0, 4.0))
    stretch = found.strains[:, 3] - 1.0
    rigidity = (
        robot.axial_stiffness
        if np.ndim(robot.axial_stiffness) == 0
        else np.repeat(robot.axial_stiffness, len(stretch) // len(robot.axial_stiffness))
    )
    assert found.link_limits.axial_forces == pytest.approx(rigidity * stretch, rel=1e-9)
    assert found.link_limits.axial_forces[0] == pytest.approx(4.0 - 2.0 * len(tensions) / 2, rel=1e-9)
