"""Laws of `inflated_beam`: energy, scaling, order and round trips, for any tube."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import mpmath as mp
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from softrobots import ParameterError, inflated_beam
from tests.support.closed_form_calls import CALLS
from tests.support.laws import law

BROADCASTING = ["wrinkling_moment", "required_pressure", "required_tabulated_pressure", "deflection", "moment"]
BROADCASTING += ["stiffness_from_young_modulus", "young_modulus_from_stiffness"]
BROADCASTING += ["beam_stiffness", "two_hinges", "moment_limits", "slack_wall_moment"]
ROUNDING = 1e-14  # a few dozen operations on positive numbers


class Tube(NamedTuple):
    """A tube and its wall."""

    length: float
    radius: float
    wall_thickness: float
    pressure: float
    poisson_ratio: float

    def scaled(self, size: float, stress: float) -> Tube:
        """Everything `size` times as long, and every pressure `stress` times as high."""
        lengths = (size * self.length, size * self.radius, size * self.wall_thickness)
        return Tube(*lengths, stress * self.pressure, self.poisson_ratio)

    def rigidities(self, modulus: float) -> tuple[float, float]:
        """Against bending [N m^2] and shear [N], without section properties: P/S I is half of P r^2, j G S is E pi r t / ..."""
        _, r, t, p, nu = self
        return math.pi * r**3 * (modulus * t + 0.5 * p * r), math.pi * r * (p * r + 0.5 * modulus * t / (1.0 + nu))


def decades(low: float, high: float) -> st.SearchStrategy[float]:
    """Positive numbers, as many small as large ones."""
    return st.floats(math.log10(low), math.log10(high)).map(lambda exponent: 10.0**exponent)


tubes_ = st.builds(
    lambda length, radius, thin, pressure, nu: Tube(length, radius, thin * radius, pressure, nu),
    decades(0.02, 50.0),
    decades(1e-3, 1.0),
    decades(1e-4, 0.099),
    st.one_of(st.just(0.0), decades(1.0, 1e7)),
    st.floats(-0.9, 0.5),
)
moduli_ = decades(1e4, 1e12)
shares_ = st.floats(0.0, 1.0)
factors_ = decades(1e-3, 1e3)


# --- Two hinges


@law("inflated_beam.beam_stiffness", "inflated_beam.BeamStiffness")
@settings(max_examples=40)
@given(tubes_, moduli_, st.one_of(st.none(), moduli_))
def test_the_stiffness_of_a_tube_is_that_of_its_wall_under_tension(tube: Tube, modulus: float, shear: float | None) -> None:
    """Round the wall, whose length carries p r / 2: (E t + p r / 2) y^2 against bending, (G t + p r / 2) r^2 against torsion.

    The sums over 12 places are exact for a cosine squared. Half of the wall, and the force on the cap, against shear.
    """
    _, r, t, p, _ = tube
    angle = 2.0 * math.pi * np.arange(12) / 12.0
    each, g = 2.0 * math.pi * r / 12.0, modulus / 2.6 if shear is None else shear
    found = inflated_beam.beam_stiffness(modulus, pressure=p, radius=r, wall_thickness=t, shear_modulus=shear)
    expected = inflated_beam.BeamStiffness(
        bending=np.sum((modulus * t + 0.5 * p * r) * (r * np.cos(angle)) ** 2) * each,
        shear=p * math.pi * r**2 + 0.5 * 12 * g * t * each,
        twisting=12 * (g * t + 0.5 * p * r) * r**2 * each,
    )
    assert found == pytest.approx(expected, rel=ROUNDING)


@law("inflated_beam.two_hinges", "inflated_beam.TwoHinges")
@settings(max_examples=40)
@given(tubes_, moduli_)
def test_two_hinges_give_way_as_the_beam(tube: Tube, modulus: float) -> None:
    """Under a small force and moment at the end: the energy of the beam, integrated along it, and that of the springs."""
    length, sizes = tube.length, {"pressure": tube.pressure, "radius": tube.radius, "wall_thickness": tube.wall_thickness}
    beam = inflated_beam.beam_stiffness(modulus, **sizes)
    assume(6.0 * beam.bending < 0.999 * beam.shear * length**2)
    found = inflated_beam.two_hinges(beam, length)
    assert isinstance(found, inflated_beam.TwoHinges)
    nodes, weights = np.polynomial.legendre.leggauss(2)  # exact for the square of a moment that is linear
    along, share = 0.5 * length * (1.0 + nodes), 0.5 * length * weights
    places = 0.5 * length + found.distance * np.array([-1.0, 1.0])
    assert places[0] > 0.0
    for force, moment in ((1.0, 0.0), (0.0, length), (1.0, -0.3 * length)):
        smooth = share @ ((force * (length - along) + moment) ** 2 / beam.bending + force**2 / beam.shear)
        lumped = np.sum((force * (length - places) + moment) ** 2) / found.stiffness
        assert lumped == pytest.approx(smooth, rel=10.0 * ROUNDING)
    assert found.twist_stiffness == pytest.approx(1.0 / (share @ np.full(2, 1.0 / beam.twisting)), rel=ROUNDING)


# --- Bending


@law("inflated_beam.deflection")
@settings(max_examples=40)
@given(tubes_, moduli_, st.floats(-100.0, 100.0), shares_)
def test_deflection_is_that_of_both_rigidities(tube: Tube, modulus: float, force: float, share: float) -> None:
    """A cantilever under a tip force; and half the work of the force is the energy of bending and shear."""
    bending, shear = tube.rigidities(modulus)
    x, length = share * tube.length, tube.length
    found = inflated_beam.deflection([x, length], force, young_modulus=modulus, **tube._asdict())
    exact = [force * (s * s * (3.0 * length - s) / (6.0 * bending) + s / shear) for s in (x, length)]
    assert found == pytest.approx(exact, rel=ROUNDING, abs=1e-300)
    nodes, weights = np.polynomial.legendre.leggauss(2)  # exact for the square of a moment that is linear
    moments = force * (length - 0.5 * length * (1.0 + nodes))
    energy = 0.25 * length * float(weights @ moments**2) / bending + 0.5 * force**2 * length / shear
    assert 0.5 * force * found[1] == pytest.approx(energy, rel=ROUNDING, abs=1e-300)


@law("inflated_beam.deflection", "inflated_beam.stiffness_from_young_modulus", "inflated_beam.young_modulus_from_stiffness")
@settings(max_examples=40)
@given(tubes_, moduli_, factors_, factors_)
def test_larger_and_harder_tubes_are_similar(tube: Tube, modulus: float, size: float, stress: float) -> None:
    """Deflections grow with the size under forces `stress size^2`; stiffness [N m] is a stress times a volume."""
    other = tube.scaled(size, stress)
    one = inflated_beam.deflection(tube.length, 1.0, young_modulus=modulus, **tube._asdict())
    two = inflated_beam.deflection(other.length, stress * size**2, young_modulus=stress * modulus, **other._asdict())
    assert float(two) == pytest.approx(size * float(one), rel=ROUNDING)
    k = inflated_beam.stiffness_from_young_modulus(modulus, **tube._asdict())
    scaled = inflated_beam.stiffness_from_young_modulus(stress * modulus, **other._asdict())
    assert scaled == pytest.approx(stress * size**3 * k, rel=ROUNDING)
    pulled = 2.0 * k  # above what the pressure gives, so that the modulus is no small difference
    back = inflated_beam.young_modulus_from_stiffness(pulled, **tube._asdict())
    assert inflated_beam.young_modulus_from_stiffness(stress * size**3 * pulled, **other._asdict()) == pytest.approx(
        stress * back, rel=10.0 * ROUNDING
    )


@law("inflated_beam.stiffness_from_young_modulus")
@settings(max_examples=40)
@given(tubes_, moduli_, decades(1e-6, 1.0))
def test_pressure_and_modulus_stiffen(tube: Tube, modulus: float, more: float) -> None:
    """And in proportion at most: a share more of one of them is at most that share more of stiffness."""
    k = inflated_beam.stiffness_from_young_modulus(modulus, **tube._asdict())
    harder = inflated_beam.stiffness_from_young_modulus(modulus * (1.0 + more), **tube._asdict())
    fuller = inflated_beam.stiffness_from_young_modulus(
        modulus, **tube._replace(pressure=tube.pressure * (1.0 + more))._asdict()
    )
    both = inflated_beam.stiffness_from_young_modulus(modulus * (1.0 + more), **tube.scaled(1.0, 1.0 + more)._asdict())
    rounded = 1.0 + ROUNDING
    assert k <= harder * rounded
    assert k <= fuller * rounded
    assert max(harder, fuller) <= both * rounded
    assert both == pytest.approx(k * (1.0 + more), rel=ROUNDING)


@law("inflated_beam.young_modulus_from_stiffness")
@settings(max_examples=60)
@given(
    *[decades(1e-29, 1e29)] * 3,
    decades(1e-9, 0.099),
    st.one_of(st.just(0.0), decades(1e-30, 1e30)),
    st.one_of(st.floats(-0.9, 0.5), st.just(math.nextafter(-1.0, 0.0))),
)
def test_the_modulus_is_the_root_at_200_digits(
    k: float, length: float, radius: float, thin: float, p: float, nu: float
) -> None:
    """Of `a/(E + s) + b/(E + t) = 1`, to some rounding times the condition number; refused where it is not positive."""
    wall = thin * radius
    assume(wall >= 1e-30)
    with mp.workdps(200):
        L, r, t, P = mp.mpf(length), mp.mpf(radius), mp.mpf(wall), mp.mpf(p)
        c = mp.pi * r * t / (2 * (1 + mp.mpf(nu)))  # j S / (2 (1 + nu))
        a, b = k * L / (3 * mp.pi * r**3 * t), k / (c * L)
        stress, shear = P * r / (2 * t), P * mp.pi * r**2 / c
        half = (a + b - stress - shear) / 2
        exact = half + mp.sqrt(half**2 + a * shear + b * stress - stress * shear)
        tube = {"length": length, "radius": radius, "wall_thickness": wall, "pressure": p, "poisson_ratio": nu}
        try:
            found = inflated_beam.young_modulus_from_stiffness(k, **tube)
        except ParameterError as error:
            assert error.field == "stiffness"
            assert exact < 1e-12 * (stress + shear)
            return
        slope = a / (exact + stress) ** 2 + b / (exact + shear) ** 2
        condition = (a * stress / (exact + stress) ** 2 + b * shear / (exact + shear) ** 2 + 1) / (slope * exact)
        assert abs(found - exact) <= 2e-15 * condition * exact


@law("inflated_beam.young_modulus_from_stiffness", "inflated_beam.stiffness_from_young_modulus")
@settings(max_examples=20)
@given(tubes_.filter(lambda tube: tube.pressure > 0.0))
def test_what_the_pressure_gives_is_the_least_stiffness(tube: Tube) -> None:
    bending, shear = tube.rigidities(0.0)
    floor = tube.length**2 / (tube.length**3 / (3.0 * bending) + tube.length / shear)
    # A wall of a billionth of the stress of the pressure adds no more than its share.
    soft = 1e-9 * tube.pressure
    assert inflated_beam.stiffness_from_young_modulus(soft, **tube._asdict()) == pytest.approx(floor, rel=1e-8)
    assert inflated_beam.young_modulus_from_stiffness(floor * (1.0 + 1e-9), **tube._asdict()) > 0.0
    with pytest.raises(ParameterError, match="the stiffness due to the pressure alone"):
        inflated_beam.young_modulus_from_stiffness(floor * (1.0 - 1e-9), **tube._asdict())


@law("inflated_beam.wrinkling_moment", "inflated_beam.required_pressure", "inflated_beam.required_tabulated_pressure")
@settings(max_examples=40)
@given(decades(1.0, 1e7), decades(1e-3, 1.0), factors_, factors_)
def test_wrinkling_moment_is_a_pressure_times_a_volume(pressure: float, radius: float, stress: float, size: float) -> None:
    moment = inflated_beam.wrinkling_moment(pressure, radius)
    assert inflated_beam.wrinkling_moment(stress * pressure, size * radius) == pytest.approx(
        stress * size**3 * moment, rel=ROUNDING
    )
    assert inflated_beam.required_pressure(moment, radius) == pytest.approx(pressure, rel=ROUNDING)
    # pi/4 of the cap force at the lever of the radius
    assert moment == pytest.approx(0.25 * math.pi * radius * (pressure * math.pi * radius**2), rel=ROUNDING)
    rows = [row.pressure for row in inflated_beam.TABLE_3]
    found = inflated_beam.required_tabulated_pressure(moment, radius)
    enough = [inflated_beam.wrinkling_moment(row, radius) >= moment for row in rows]
    if not any(abs(pressure - row) < ROUNDING * row for row in rows):
        assert found == (rows[enough.index(True)] if any(enough) else None)


@law("inflated_beam.moment")
@settings(max_examples=40)
@given(st.floats(-2.0, 2.0), decades(1.0, 1e4), decades(1e-2, 1e3))
def test_moment_is_the_slope_of_its_energy(angle: float, stiffness: float, most: float) -> None:
    """`k theta^2/2` up to the knee and a straight line from there; odd, never above `k |theta|` nor above the plateau."""

    def energy(theta: float) -> float:
        bend, knee = abs(theta), most / stiffness
        return 0.5 * stiffness * bend**2 if bend < knee else most * (bend - 0.5 * knee)

    found = float(inflated_beam.moment(angle, stiffness=stiffness, max_moment=most))
    assert float(inflated_beam.moment(-angle, stiffness=stiffness, max_moment=most)) == -found
    assert abs(found) <= min(stiffness * abs(angle), most)
    step = 1e-4 * most / stiffness
    slope = (energy(angle + step) - energy(angle - step)) / (2.0 * step)
    # At the knee the slope bends: half a step of stiffness. Elsewhere rounding of the energy over the step.
    bound = 1e-13 * max(energy(angle), most**2 / stiffness) / step
    assert abs(found - slope) <= bound + (0.5 * stiffness * step if abs(abs(angle) * stiffness - most) < 2e-4 * most else 0.0)


def parts(answer: Any) -> tuple[Any, ...]:
    """Fields of an answer, or the answer itself."""
    return answer if isinstance(answer, tuple) else (answer,)


@settings(max_examples=8)
@given(data=st.data())
@pytest.mark.parametrize("name", BROADCASTING)
def test_arrays_are_taken_element_by_element(name: str, data: st.DataObject) -> None:
    """Arguments are numbers, rows or columns: the answer is that of each pair of numbers, to the rounding of powers.

    Numbers alone give a number.
    """
    function, given = CALLS[name]
    function = inflated_beam.required_tabulated_pressure if name == "required_tabulated_pressure" else function
    random = np.random.default_rng(data.draw(st.integers(0, 2**32 - 1)))
    shapes = {key: data.draw(st.sampled_from([(), (3,), (2, 1), (2, 3)])) for key in given}
    arguments = {key: value * random.uniform(0.8, 1.0, shapes[key]) for key, value in given.items()}
    found = parts(function(**arguments))
    shape = np.broadcast_shapes(*shapes.values())
    assert {np.shape(part) for part in found} == {shape}
    for place in np.ndindex(shape):
        numbers = {key: float(np.broadcast_to(value, shape)[place]) for key, value in arguments.items()}
        for part, one in zip(found, parts(function(**numbers)), strict=True):
            assert one is None or isinstance(one, float)
            expected = np.inf if one is None and shape else one
            assert (part if shape == () else part[place]) == pytest.approx(expected, rel=1e-14)


# --- Characterisation


@law("inflated_beam.fit_characterisation", "inflated_beam.moment", "inflated_beam.Characterisation")
@settings(max_examples=25)
@given(
    decades(10.0, 1e4),
    st.floats(1.05, 3.0),
    st.integers(4, 30),
    st.integers(3, 30),
    decades(1e3, 1e6),
    st.integers(0, 2**32 - 1),
)
def test_a_fit_returns_the_law_of_its_data(k: float, above: float, n: int, past: int, pressure: float, seed: int) -> None:
    """Without noise, whatever the order of the points and whichever way each was bent; and it scales with the moments."""
    random, radius = np.random.default_rng(seed), 0.055
    wrinkling = inflated_beam.wrinkling_moment(pressure, radius)
    most = above * wrinkling
    knee = most / k
    angle = np.concatenate([np.linspace(0.02, 0.95, n) * wrinkling / k, np.linspace(1.1, 2.0, past) * knee])
    angle = random.permutation(angle) * random.choice([-1.0, 1.0], n + past)
    data = inflated_beam.moment(angle, stiffness=k, max_moment=most)
    fit = inflated_beam.fit_characterisation(angle, data, pressure=pressure, radius=radius)
    assert isinstance(fit, inflated_beam.Characterisation)
    assert (fit.stiffness, fit.max_moment) == (pytest.approx(k, rel=1e-13), pytest.approx(most, rel=1e-13))
    assert fit.stiffness_std == pytest.approx(0.0, abs=1e-13 * k)
    assert (fit.n_linear, fit.n_saturated) == (n, past)
    assert fit.mean_moment_above_wrinkling == pytest.approx(most, rel=1e-13)
    assert fit.wrinkling_moment == wrinkling
    other = inflated_beam.fit_characterisation(angle, 8.0 * data, pressure=8.0 * pressure, radius=radius)
    assert other.stiffness == 8.0 * fit.stiffness  # a power of two changes no digit
    assert other.max_moment == 8.0 * fit.max_moment


@law("inflated_beam.CharacterisationRow", "inflated_beam.required_tabulated_pressure")
@settings(max_examples=10)
@given(st.floats(0.0, 1.0))
def test_the_rows_of_the_table_carry_their_wrinkling_moment(share: float) -> None:
    """A row carries every moment up to its own; the plateaus that the paper measured lie 6 to 22 % above that."""
    for row in map(inflated_beam.CharacterisationRow._make, inflated_beam.TABLE_3):
        wrinkling = inflated_beam.wrinkling_moment(row.pressure, 0.055)
        assert inflated_beam.required_tabulated_pressure(share * wrinkling * (1.0 - 1e-15), 0.055) <= row.pressure
        assert row.max_moment is None or 1.05 * wrinkling < row.max_moment < 1.22 * wrinkling


tests_ = st.builds(
    lambda hinge, arm, offset: inflated_beam.BendingTest(probe_distance=hinge + arm, hinge_offset=hinge, offset=offset * arm),
    st.floats(0.0, 0.2),
    st.floats(0.05, 2.0),
    st.floats(0.0, 0.9),
)


@law("inflated_beam.BendingTest")
@settings(max_examples=40)
@given(tests_, st.floats(-1.4, 1.4), st.floats(-100.0, 100.0))
def test_a_bending_test_is_a_circle_that_touches_a_line(test: Any, angle: float, force: float) -> None:
    """The probe's centre keeps its distance from the bent axis; its foot is the contact; its work turns the hinge."""
    assume(math.sin(angle) * test.offset < 0.95 * test.arm)  # beyond, pushing on would turn the hinge back
    moved = float(test.displacement(angle))
    centre = np.array([test.arm, moved - test.offset])
    axis, normal = np.array([math.cos(angle), math.sin(angle)]), np.array([-math.sin(angle), math.cos(angle)])
    size = float(np.abs(centre).sum())
    assert normal @ centre == pytest.approx(-test.offset, abs=1e-14 * size)
    assert float(test.contact(angle)) == pytest.approx(axis @ centre, abs=1e-14 * size / math.cos(angle))
    step = 1e-6
    slope = (test.displacement(angle + step) - test.displacement(angle - step)) / (2.0 * step)
    # The condition of the inverse is the reciprocal slope; differences: step^2 times the third derivative, rounding over step.
    steep = size / math.cos(angle) ** 4
    assert float(test.angle(moved)) == pytest.approx(angle, abs=1e-14 * size / float(slope) + 1e-15)
    assert float(test.moment(moved, force)) == pytest.approx(force * float(slope), abs=abs(force) * 1e-8 * steep)


@law("inflated_beam.BendingTest")
@settings(max_examples=20)
@given(tests_, st.floats(-1e-3, 1e-3), st.floats(-100.0, 100.0))
def test_small_angles_are_the_limit(test: Any, angle: float, force: float) -> None:
    """The first order is left out: `v = a theta - c theta^2/2 + ...` and `tau = F (a - c theta) + ...`."""
    moved = test.displacement(angle)
    bent, moment = test.small_angles(moved, force)
    assert float(bent) == pytest.approx(angle, abs=0.5 * angle**2 + abs(angle) ** 3 + ROUNDING * abs(angle))
    allowed = (1.01 * abs(angle) + 1e-15) * abs(force) * test.arm
    assert float(moment) == pytest.approx(float(test.moment(moved, force)), abs=allowed)
