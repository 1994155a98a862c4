"""[Blumenschein 2018], helical actuation of an inflated tube: its equations, numbers and curves beside ours.

The test grid and the grasped cylinder of the paper are `studies.papers.helix_grid` and `softrobots.helix.PAPER_CYLINDER`; other
printed numbers stand here.

References:
    [Blumenschein 2018]: L. H. Blumenschein, N. S. Usevitch, B. H. Do, E. W. Hawkes, A. M. Okamura, Helical Actuation on a Soft
        Inflated Robot Body, RoboSoft 2018.
"""

from __future__ import annotations

import numpy as np

from softrobots import helix
from softrobots.core.checks import FloatArray
from softrobots.helix import PAPER_CYLINDER
from studies.papers import helix_equations as printed
from studies.papers.helix_equations import Shape
from studies.papers.helix_grid import PAPER_ANGLES, PAPER_CONTRACTIONS, PAPER_DIAMETER, PAPER_SCALED, paper_grid
from studies.papers.rows import MEASURED, UNPUBLISHED, Row, absent, equation, erratum, largest, mended, own, rounded, taken

TITLE = "Helical actuation [Blumenschein 2018]"
"""What the paper is called in tables."""

SCALE = "2.5"
"""Figure 6: larger radii and pitch, at 5 degrees and 0.66."""
ERRORS = {"outer radius": "2.6", "pitch": "3.3"}
"""Section III-B: mean differences between measured and predicted shapes [mm]."""
OBJECT_DIAMETER, OBJECT_HEIGHT, LARGEST_RADIUS = "4.0", "12", "4.0"
"""Section III-C: the grasped cylinder, and the radii of the helices [cm]."""
GAP, RISE, TURNS = "3", "8.0", "1.5"
"""Section III-C: gap between the halves of the cylinder [mm], pitch of the helices [cm], and their revolutions."""
SENSOR_RANGE, SENSOR_RESOLUTION = "12", "0.3"
"""Section III-C: range [N] and resolution [mN] of the sensor between the halves."""
R_SQUARED = "0.958"
"""Section III-C: mean R^2 of force against pressure."""

_SHARE, _ANGLE = float(PAPER_SCALED.contraction), float(PAPER_SCALED.angle)
_EXAMPLE = "theta = 5 degrees, lambda = 0.66, D = 3.31 cm"
_CASES = 1000
_RANDOM = "1000 random actuators, 1 to 45 degrees, lambda 0.2 to 0.98, D 1 to 10 cm"
_PATHS = ("outer", "inner", "centre")


def paths() -> list[Row]:
    """Equations (1) to (5) and (8) to (10): the curves and their frames."""
    share, angle, tube = _random()
    shape = helix.forward(share, angle, tube)
    s = np.random.default_rng(1).uniform(-10.0, 10.0, _CASES)
    quarter, lift = s - np.pi / 2, shape.pitch * np.pi / 2  # (1) starts on y, ours on x
    curve = tangents = normals = 0.0
    for name in _PATHS:
        radius = shape.radius(name)
        ours = helix.points(shape, quarter, name, "left") + np.stack([0 * lift, 0 * lift, lift], axis=-1)
        curve = max(curve, largest(ours - printed.path(radius, shape.pitch, s)))
        tangents = max(
            tangents, largest(helix.tangents(shape, quarter, name, "left") - printed.tangent(radius, shape.pitch, s))
        )
        normals = max(normals, largest(helix.normals(shape, quarter, name, "left") - printed.normal(s)))
    example = helix.forward(_SHARE, _ANGLE, PAPER_DIAMETER)
    torsion = printed.curvature_torsion(example.outer_radius, example.pitch)[1]
    signed = helix.curvature_torsion(example, "outer", "left")[1]
    note = (
        f"the curve (1) is left-handed for b > 0, its torsion negative; the library takes the hand as an argument. {_EXAMPLE}"
    )
    rows = [
        equation("(1), (3)-(5)", "outer, inner and centre path", curve, "m", "the library's left-handed helix"),
        erratum("(13)", "signed torsion of the outer curve (1)", float(torsion), float(signed), "rad/m", note),
        equation("(8)", "tangents of the three paths", tangents, "", _RANDOM),
        equation("(9)", "normals of the three paths", normals, "", _RANDOM),
    ]
    straight = helix.forward(1.0, np.array(PAPER_ANGLES), PAPER_DIAMETER)
    apart = largest(printed.actuator_angle(np.asarray(PAPER_DIAMETER), straight.pitch) - PAPER_ANGLES)
    rows.append(
        equation("(2)", "angle of the actuator on the straight tube", apart, "rad", "2.5, 5 and 10 degrees, lambda = 1")
    )
    outer, inner, centre = (helix.tangents(shape, s, name) for name in _PATHS)
    apart = largest(np.sum(outer * inner, axis=-1) - np.cos(2 * angle))
    rows.append(equation("(10)", "outer and inner tangent, cos 2 theta", apart, "", _RANDOM))
    outer, inner, centre = (helix.tangents(example, 0.0, name) for name in _PATHS)
    for name, other in (("outer", outer), ("inner", inner)):
        found = float(np.degrees(np.arccos(np.clip(other @ centre, -1.0, 1.0))))
        note = f"printed theta for both; only their sum is 2 theta. {_EXAMPLE}"
        rows.append(
            erratum("Figure 3", f"angle between {name} and centre tangent", np.degrees(_ANGLE), found, "degrees", note, 0.1)
        )
    return rows


def closed_form() -> list[Row]:
    """Table I and equations (6), (7) and (11) to (15)."""
    share, angle, tube = _random()
    shape = helix.forward(share, angle, tube)
    plain = Shape(shape.outer_radius, shape.inner_radius, shape.pitch)
    actuator = helix.inverse(shape)
    given = printed.forward(share, angle, tube)
    apart = max(largest((ours - theirs) / shape.outer_radius) for ours, theirs in zip(plain, given, strict=True))
    rows = [
        equation("(6)", "contraction from a shape", largest(actuator.contraction - printed.contraction(plain)), "", _RANDOM),
        equation("(7)", "diameter from a shape", largest(actuator.diameter - printed.diameter(plain)), "m", _RANDOM),
        equation(
            "(11)", "angle from a shape, cos 2 theta", largest(np.cos(2 * actuator.angle) - printed.cosine(plain)), "", _RANDOM
        ),
        equation("(12)", "Ro, Ri and b from an actuator", apart, "", f"relative to Ro; {_RANDOM}", 1e-10),
    ]
    apart = form = 0.0
    values: list[tuple[FloatArray, FloatArray]] = []
    for name, at in (("outer", 0), ("inner", 2)):
        ours = helix.curvature_torsion(shape, name)
        values.append(ours)
        by_shape = printed.curvature_torsion(shape.radius(name), shape.pitch)
        by_actuator = printed.curvatures_torsions(share, angle, tube)[at : at + 2]
        apart = max(apart, *(largest((one - other) * tube) for one, other in zip(ours, by_shape, strict=True)))
        form = max(form, *(largest((one - other) * tube) for one, other in zip(ours, by_actuator, strict=True)))
    rows.append(equation("(13)", "curvature and torsion from Ro, Ri and b", apart, "", f"times D; {_RANDOM}"))
    pitches = [torsion / (torsion**2 + curvature**2) for curvature, torsion in values]
    rows.append(
        equation("(14)", "pitch of both paths from curvature and torsion", largest(pitches[0] - pitches[1]), "m", _RANDOM)
    )
    rows.append(equation("(15)", "curvature and torsion from an actuator", form, "", f"times D; {_RANDOM}", 1e-10))
    example = helix.forward(_SHARE, _ANGLE, PAPER_DIAMETER)
    for name, value in (("Ro", example.outer_radius), ("Ri", example.inner_radius), ("b", example.pitch)):
        rows.append(
            own("(12)", f"{name} of the helix of Figure 6", 100.0 * float(value), "cm" if name != "b" else "cm/rad", _EXAMPLE)
        )
    return rows


def measuring() -> list[Row]:
    """Equations (16) and (17), and the stoppers."""
    share, angle, tube = _random()
    shape = helix.forward(share, angle, tube)
    length = {name: printed.turn_length(shape.radius(name), shape.pitch) for name in ("outer", "inner")}
    apart = max(largest(helix.turn_angle(shape, arc, name) - 2 * np.pi) for name, arc in length.items())
    rows = [equation("(17)", "length of a turn, as the angle that it makes", apart, "rad", _RANDOM)]
    example = helix.forward(_SHARE, _ANGLE, PAPER_DIAMETER)
    outer, inner = (float(printed.turn_length(example.radius(name), example.pitch)) for name in ("outer", "inner"))
    theirs, ours = printed.from_arcs(outer, inner, PAPER_DIAMETER), helix.measure(outer, inner, PAPER_DIAMETER)
    note = f"printed m - D/2 and m - 3 D/2, must be m + D/2 and m - D/2; {_EXAMPLE}"
    told_b = "follows from Ro. The mean errors of Figure 7 are below a tenth of this: the paper must have used the right one"
    for name, one, other, why in (
        ("Ro", theirs.outer, ours.outer_radius, note),
        ("Ri", theirs.inner, ours.inner_radius, note),
        ("b", theirs.pitch, ours.pitch, told_b),
    ):
        unit = "cm" if name != "b" else "cm/rad"
        rows.append(erratum("(16)", f"{name} from the arcs of a turn", 100.0 * float(one), 100.0 * float(other), unit, why))
    back = helix.measure(length["outer"], length["inner"], tube)
    apart = largest(
        np.stack([back.outer_radius - shape.outer_radius, back.inner_radius - shape.inner_radius]) / shape.outer_radius
    )
    note = f"relative to Ro; {_RANDOM}"
    rows.append(mended(equation("(16), mended", "Ro and Ri from the arcs, against (12)", apart, "", note, 1e-10)))
    stopper, gap = np.random.default_rng(2).uniform(0.001, 0.02, (2, 100))
    apart = largest(helix.contraction_from_stoppers(stopper, gap) - stopper / (stopper + gap))
    note = "stopper / (stopper + gap)"
    rows.append(taken(equation("section III-A.2", "contraction from stoppers and gaps", apart, "", note)))
    return rows


def figures_5_to_7() -> list[Row]:
    """The grid, the scaled helix, and the curves of outer radius and pitch."""
    table = paper_grid().rows
    grid = table[: len(PAPER_ANGLES) * len(PAPER_CONTRACTIONS)]
    note = "of the grid 2.5, 5, 10 degrees by lambda 0.5 to 0.9 in steps of 0.1 (steps ours), D = 3.31 cm"
    rows = [own("Figure 5", "helices that would run into themselves", float(sum(not row.realisable for row in grid)), "", note)]
    small, large = table[-2:]
    for name in ("outer_radius", "inner_radius", "pitch"):
        ratio = getattr(large, name) / getattr(small, name)
        note = "D larger by 2.5, to which (12) is proportional; 5 degrees, 0.66"
        rows.append(taken(rounded("Figure 6", f"growth of {name.replace('_', ' ')}", SCALE, ratio, "", note)))
    for name, text in ERRORS.items():
        note = "mean difference of the test helices from (12): the measured arcs are not published"
        rows.append(absent(MEASURED, "Figure 7", f"mean error of the {name}", text, "mm", note))
    angles = np.array(PAPER_ANGLES)
    start, end = helix.forward(1.0, angles, PAPER_DIAMETER), helix.forward(1e-15, angles, PAPER_DIAMETER)
    apart = largest(np.stack([start.outer_radius - PAPER_DIAMETER / 2, start.pitch - PAPER_DIAMETER / (2 * np.tan(angles))]))
    rows.append(equation("Figure 7", "start of the curves: Ro = D/2, b that of the actuator", apart, "m", "lambda = 1"))
    apart = largest(np.stack([end.outer_radius - PAPER_DIAMETER, end.inner_radius, end.pitch]))
    rows.append(equation("Figure 7", "end of the curves: Ro = D, Ri = 0, b = 0", apart, "m", "lambda = 1e-15"))
    for angle in PAPER_ANGLES:
        name = f"{np.degrees(angle):.4g} degrees"
        simple, exact = float(helix.simple_contraction_limit(angle)), float(helix.contraction_limit(angle))
        note = "dotted line of the figure, 2 pi b = D; its numbers are not printed"
        rows.append(own("Figure 7", f"smallest lambda, {name}, simple rule", simple, "", note))
        rows.append(
            own("Figure 7", f"smallest lambda, {name}, turns just touch", exact, "", "exact distance of neighbouring turns")
        )
    note = "the text gives no size of the antenna; softrobots.helix.design_antenna makes one from radius, rise and turns"
    rows.append(absent(UNPUBLISHED, "Figure 1", "the helical antenna", note=note))
    return rows


def grasping() -> list[Row]:
    """Section III-C: the grasped cylinder and Figure 9."""
    test = PAPER_CYLINDER
    note = "1.5 turns of 8.0 cm rise are as high as the cylinder"
    sizes = [
        rounded("section III-C", "height of the cylinder", OBJECT_HEIGHT, 100.0 * test.turns * test.turn_height, "cm", note),
        rounded("section III-C", "diameter of the cylinder", OBJECT_DIAMETER, 200.0 * test.object_radius, "cm"),
        rounded("section III-C", "gap between its halves", GAP, 1e3 * test.gap, "mm"),
        rounded("section III-C", "rise of the helix per turn", RISE, 100.0 * test.turn_height, "cm"),
        rounded("section III-C", "turns around the cylinder", TURNS, test.turns),
    ]
    rows = [taken(row) for row in sizes]
    note = "printed for radii of helices that grip a cylinder of 4.0 cm diameter: half of it must be meant"
    rows.append(erratum("section III-C", "largest inner radius", float(LARGEST_RADIUS), 100.0 * test.object_radius, "cm", note))
    pressures = np.linspace(0.0, 10e3, 6)[:, None]
    found = test.force(pressures)
    apart = float(found.unwrapping[-1, 0]) - 10e3 * _volume_lost()
    note = "our V(L) by our differences, 10 kPa; the paper gives no volume"
    rows.append(taken(equation("(18)", "F = P dV/dL for bound (a) of our model", abs(apart), "N", note, 1e-6)))
    apart = largest(found.force * pressures[-1] - found.force[-1] * pressures)
    rows.append(taken(equation("Figure 9", "force linear in the pressure, our model", apart / 10e3, "N", "0 to 10 kPa")))
    note = "bound (b) of our model; the paper explains by the gap why it measures some"
    apart = largest(test._replace(gap=0.0).force(pressures).force[:, 0])
    rows.append(taken(equation("Figure 9", "no force without gap and deflection, our model", apart, "N", note)))
    note = "our model, not the paper's; 10 kPa, D = 3.31 cm assumed. The paper's forces are not printed, and rise up to 4 mm"
    for depth, force in zip(test.deflections, found.force[-1], strict=True):
        rows.append(own("Figure 9", f"force, deflected by {1e3 * depth:g} mm", float(force), "N", note))
    note = "our model, not the paper's, whose forces are not printed; within the range of its sensor"
    rows.append(own("section III-C", "largest force of our model at 10 kPa", float(found.force.max()), "N", note))
    rows.append(absent(MEASURED, "section III-C", "range of the sensor", SENSOR_RANGE, "N", "the forces are not published"))
    note = "resolution of the sensor; the forces are not published"
    rows.append(absent(MEASURED, "section III-C", "smallest difference of forces", SENSOR_RESOLUTION, "mN", note))
    raw = "pressures and forces of the test are not published"
    rows.append(
        absent(MEASURED, "Figure 9", "mean R^2 of force against pressure", R_SQUARED, note=f"{raw}; 1 in any model of (18)")
    )
    rows.append(absent(MEASURED, "Figure 9", "forces", note=raw))
    for depth in test.deflections:
        result = helix.design_grasp(
            test.object_radius, test.turn_height, diameter=test.diameter, turns=test.turns, squeeze=depth
        )
        note = "from (6) and (11); the paper does not print its actuators. D = 3.31 cm assumed"
        name = f"of the helix deflected by {1e3 * depth:g} mm"
        rows.append(own("section III-C", f"lambda {name}", result.contraction, "", note))
        rows.append(own("section III-C", f"theta {name}", float(np.degrees(result.angle)), "degrees", note))
    return rows


def _volume_lost() -> float:
    """Volume that the tube around the cylinder loses per gap between its halves, by central differences [m^2].

    The inner line keeps its length, so the turns become fewer.
    """
    test, step = PAPER_CYLINDER, 3e-5
    pitch, gaps = test.turn_height / (2 * np.pi), test.gap + np.array([-step, step])
    at_test, radii = (test.object_radius + gap / np.pi for gap in (test.gap, gaps))
    turns = test.turns * np.hypot(at_test, pitch) / np.hypot(radii, pitch)
    sizes = {"object_radius": test.object_radius, "turn_height": test.turn_height, "diameter": test.diameter}
    volume = helix.grasp_force(0.0, deflection=0.0, turns=turns, gap=gaps, **sizes).volume
    return float(volume[0] - volume[1]) / (2 * step)


def _random() -> tuple[FloatArray, FloatArray, FloatArray]:
    """Contractions, angles [rad] and diameters [m], each shape (n,)."""
    random = np.random.default_rng(2018)
    angles = random.uniform(np.radians(1.0), np.radians(45.0), _CASES)
    return random.uniform(0.2, 0.98, _CASES), angles, random.uniform(0.01, 0.1, _CASES)


JOBS = (paths, closed_form, measuring, figures_5_to_7, grasping)
"""What makes the rows."""
