"""Robots with actuators of any kind on any route."""

from __future__ import annotations

from collections.abc import Callable

import softrobots as sr
from tests.support.serial_chains import ARM, LENGTHS
from tests.support.serial_chains import ROBOTS as SERIAL_CHAINS

ROBOTS: dict[str, Callable[[], sr.SoftModel]] = {
    "tendons": SERIAL_CHAINS["tendons"],
    "winding": SERIAL_CHAINS["winding"],
    "by_segment": lambda: sr.load_model(sr.PccArm(**ARM, kind=("tension", "pressure"))),
    "lumped": lambda: sr.load_model(
        sr.PccArm(segment_lengths=LENGTHS, chain="lumped", hinges=1, kind=("mckibben", "elastic"), routing="base")
    ),
    "lengths_on_an_arm": lambda: sr.load_model(
        sr.mount(sr.InflatableArm().urdf(), "tip", sr.PccArm(**ARM, kind="length", routing="base"))
    ),
    "winding_lengths": SERIAL_CHAINS["coils"],
    "lumped_winding": SERIAL_CHAINS["lumped_winding"],
    "lumped_coils": SERIAL_CHAINS["lumped_coils"],
    "on_an_arm": lambda: sr.load_model(
        sr.mount(sr.InflatableArm().urdf(), "tip", sr.PccArm(**ARM, kind="elastic", routing="base"))
    ),
}
