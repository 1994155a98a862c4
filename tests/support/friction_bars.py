"""Bars and arms with dry friction that move."""

from __future__ import annotations

from typing import Any

import softrobots as sr

EI, LENGTH = 2e-3, 0.06
STIFFNESS = EI / LENGTH  # of the bending of one section [N m/rad]
STICK = 1e-4  # bending that a section gives before its friction is whole [rad]


def bar(friction: float) -> sr.SoftModel:
    """A bar that bends as one section: an oscillator of one degree of freedom, but for its slight shortening."""
    return sr.load_model(
        sr.TendonArm(
            segment_lengths=(LENGTH,),
            tendon_azimuths=(),
            bending_stiffness=EI,
            elastic_sections=1,
            bending_friction=friction,
        )
    )


def bent(model: sr.SoftModel, angle: float, friction: float) -> sr.Equilibrium:
    """The bar, bent from rest by a moment."""
    return sr.solve_equilibrium(model, [], wrench=(0.0, 0.0, 0.0, 0.0, STIFFNESS * angle + friction, 0.0))


def smooth(share: float) -> float:
    """From 0 to 1, at rest at both ends."""
    s = min(max(share, 0.0), 1.0)
    return s**3 * (10.0 - 15.0 * s + 6.0 * s * s)


def period() -> float:
    free = bar(0.0)
    return 1.0 / float(sr.vibration_modes(free, sr.solve_equilibrium(free, [])).frequencies[1])


def arm(kind: str, **fields: Any) -> sr.SoftModel:
    return sr.load_model(
        sr.TendonArm(
            segment_lengths=(LENGTH,),
            tendon_azimuths=(0.0,),
            tendon_distance=0.0045,
            bending_stiffness=EI,
            elastic_sections=2,
            kind=kind,
            **fields,
        )
    )


def released(**fields: Any) -> tuple[sr.SoftModel, sr.Equilibrium]:
    """An arm of two segments whose elastic tendons hold it bent, under a force."""
    model = sr.load_model(sr.TendonArm(segment_lengths=(0.06, 0.05), elastic_sections=1, **fields))
    return model, sr.solve_equilibrium(model, model.relaxed_motors - (2e-3, 0, 0, 0, 1e-3, 0), (0.1, 0.2, 0.0))
