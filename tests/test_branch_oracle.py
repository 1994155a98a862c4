"""Branches of random arms against brute force and a continuation that know nothing of the package (`branch_oracle`)."""

from __future__ import annotations

import numpy as np
import pytest

import softrobots as sr
from tests.support.branch_oracle import PushedArm, distance, meets

PUSH = (-1, 0, 0)
NAMES = ("spring_1_side", "spring_1_up", "spring_2_side", "spring_2_up")


def random_arm(rng: np.random.Generator, flat: bool) -> tuple[sr.SoftModel, np.ndarray, tuple[float, float]]:
    """With a plateau in each link, from 3 to 25 N m; or with four springs, in half of the cases nearly equal in each link."""
    if flat:
        stiffness, plateaus = 172.71 * np.exp(rng.uniform(-0.7, 0.7, 2)), tuple(rng.uniform(3.0, 25.0, 2).tolist())
        robot = sr.InflatableArm(stiffness=tuple(stiffness.tolist()), max_moment=plateaus)
        return sr.load_model(robot), np.repeat(stiffness, 2), plateaus
    springs = 172.71 * np.exp(rng.uniform(-0.7, 0.7, 4))
    if rng.random() < 0.5:
        springs[1::2] = springs[::2] * (1.0 + 10.0 ** rng.uniform(-9.0, -2.0, 2))
    model = sr.load_model(sr.InflatableArm().urdf(), springs=dict(zip(NAMES, springs.tolist(), strict=True)))
    return model, springs, (np.inf, np.inf)


def one_of_each_mirror_image(springs: np.ndarray) -> np.ndarray:
    """Equilibria, shape (n, 4), without the images of others in the two planes of the arm."""
    kept: list[np.ndarray] = []
    for one in springs:
        signs = [np.sign(pair[np.argmax(np.abs(pair))]) or 1.0 for pair in (one[::2], one[1::2])]
        image = one * np.tile(signs, 2)
        if all(np.abs(image - other).max() > 1e-4 for other in kept):
            kept.append(image)
    return np.array(kept).reshape(-1, 4)


def missed(rng: np.random.Generator, flat: bool, starts: int, *, without: str = "") -> tuple[list[np.ndarray], int]:
    """Equilibria of a random arm on paths that meet a branch but are none; and how many bent ones are on branches.

    Branches whose label begins with `without` are left out.
    """
    model, stiffness, plateaus = random_arm(rng, flat)
    critical = sr.critical_load(model, (0, 0, 0), PUSH)
    largest = critical * rng.uniform(1.05, 1.5)
    force = rng.uniform(0.15 * largest, 0.98 * largest) if flat else rng.uniform(1.01 * critical, 0.99 * largest)
    branches = sr.post_buckling_branches(model, (0, 0, 0), PUSH, max_force=largest)
    assert {branch.ended for branch in branches} == {"largest force"}
    lines = [
        np.column_stack([[one.q_springs for one in branch.equilibria], branch.forces / critical])
        for branch in branches
        if not (without and branch.label.startswith(without))
    ]
    arm = PushedArm(stiffness, plateaus, critical)
    found = arm.equilibria(force, rng, starts)
    places = np.column_stack([found, np.full(len(found), force / critical)])
    off = np.min([distance(line, places) for line in lines if len(line) > 1], axis=0)
    on = off < 5e-3  # points of a branch are up to 0.05 rad apart, and its chords as far from it as this
    bent = int((on & (np.abs(found).max(axis=1) > 1e-3)).sum())
    left = one_of_each_mirror_image(found[~on])
    paths = arm.paths(left, force, largest) if len(left) else []
    return [one for one, path in zip(left, paths, strict=True) if meets(path, lines)], bent


@pytest.mark.study
@pytest.mark.parametrize("flat", [False, True])
def test_no_branch_is_missed_by_brute_force_and_continuation(flat: bool) -> None:
    found, bent = missed(np.random.default_rng(3), flat, 45)
    assert not found
    assert bent >= 2


def test_the_oracle_sees_a_branch_that_is_left_out() -> None:
    """The arm of the first case above: without a branch, equilibria of that branch are paths that meet others."""
    found, _ = missed(np.random.default_rng(3), False, 45, without="+spring_1_up")
    assert found


@pytest.mark.study
@pytest.mark.shortened(2, 25)
@pytest.mark.parametrize("seed", range(8))
def test_no_branch_of_200_random_arms_is_missed(seed: int, cases: int) -> None:
    """In every other arm each link has a plateau."""
    rng, bent = np.random.default_rng([20, seed]), 0
    for case in range(cases):
        found, on_branches = missed(rng, case % 2 == 1, 200)
        assert not found, (case, found)
        bent += on_branches
    assert bent > 4 * cases
