"""What the closed forms tell of one tube that an actuator bends into a helix, for answers."""

from __future__ import annotations

from softrobots import helix
from softrobots.cli.reports.facts import Fact


def tube_facts(
    shape: helix.HelixShape, actuator: helix.Actuator, length: float, pressure: float, handedness: str
) -> list[Fact]:
    """What the closed forms tell of a tube.

    Args:
        shape: Its helix, one.
        actuator: Its actuator.
        length: Length of the uninflated tube [m].
        pressure: Gauge pressure [Pa].
        handedness: "right" or "left".

    Returns:
        The facts.

    Raises:
        ParameterError: If an argument is out of range.
    """
    contraction, angle, diameter = actuator
    turns = helix.turns(shape, angle, length)
    contact = helix.self_contact(shape, turns)
    facts = [
        Fact("contraction", contraction, "-", "contraction of the actuator"),
        Fact("angle", angle, "rad", "angle of the actuator"),
        Fact("diameter", diameter, "m", "diameter of the tube"),
        Fact("length", length, "m", "length of the uninflated tube"),
        Fact("handedness", handedness, "", "handedness"),
        Fact("outer_radius", shape.outer_radius, "m", "outer radius of the helix"),
        Fact("centre_radius", shape.centre_radius, "m", "radius of its centre line"),
        Fact("inner_radius", shape.inner_radius, "m", "inner radius"),
        Fact("pitch", shape.pitch, "m/rad", "pitch"),
        Fact("turn_height", shape.turn_height, "m", "rise of a turn"),
        Fact("turns", turns, "-", "turns"),
        Fact("height", helix.height(shape, angle, length), "m", "height"),
        Fact("centre_length", helix.centre_length(contraction, angle, length), "m", "length of the centre line"),
        Fact("volume", helix.volume(contraction, angle, diameter, length), "m^3", "volume"),
    ]
    for path in ("outer", "centre", "inner"):
        curvature, torsion = helix.actuator_curvature_torsion(contraction, angle, diameter, path, handedness)
        facts += [
            Fact(f"{path}_curvature", curvature, "1/m", f"curvature of the {path} path"),
            Fact(f"{path}_torsion", torsion, "1/m", f"torsion of the {path} path"),
        ]
    return [
        *facts,
        Fact("material_twist", helix.material_twist(contraction, angle, diameter, handedness), "rad/m", "twist of the wall"),
        Fact("pressure", pressure, "Pa", "gauge pressure"),
        Fact(
            "actuator_tension",
            helix.actuator_tension(contraction, angle, diameter, pressure),
            "N",
            "tension of the actuator",
        ),
        Fact(
            "contraction_limit", helix.contraction_limit(angle), "-", "smallest contraction without self-contact, endless tube"
        ),
        Fact("touches", contact.touches, "", "runs into itself"),
        Fact("contact", contact.describe(), "", "self-contact"),
    ]
