"""Functions of PyTorch: transformations agree with each other and with differences, in batches.

PyTorch is in no extra but its own: where it is not installed, these tests are skipped; `.ci/run` installs it for them.
"""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import softrobots as sr
from tests.conftest import CHECKOUT
from tests.support.documentation import PageRunner

if importlib.util.find_spec("torch") is None:
    pytest.skip("PyTorch is not installed", allow_module_level=True)

import torch

NAMES = ("stiffness", "hinge_offset", "motor[2].offset")
MOTORS = torch.tensor([[0.1, 0.2, 0.3], [0.4, 0.5, -0.6]], dtype=torch.float64)
FORCES = torch.tensor([[1.0, 2.0, -3.0], [0.0, -4.0, 2.0]], dtype=torch.float64)
SCALE = torch.tensor([100.0, 0.1, 1.0], dtype=torch.float64)


@pytest.fixture(scope="module")
def equilibrium() -> Any:
    """The equilibrium of an arm."""
    return sr.torch.equilibrium(sr.InflatableArm(), NAMES, backend="python")


@pytest.mark.parametrize("rows", [0, 2])
def test_derivatives_are_differences_in_both_modes(equilibrium: Any, rows: int) -> None:
    """By actuators, loads and parameters, shared by the cases or a row each."""
    scaled = equilibrium.values / SCALE
    given = [MOTORS.clone(), FORCES.clone(), scaled.repeat(rows, 1) if rows else scaled]
    given = [one.requires_grad_() for one in given]

    def of_scaled(motors: Any, forces: Any, scaled: Any) -> Any:
        return equilibrium(motors, forces, scaled * SCALE)

    # Central differences with steps of 1e-5 of what is solved to 1e-13.
    assert torch.autograd.gradcheck(of_scaled, given, eps=1e-5, atol=1e-7, rtol=1e-7, check_forward_ad=True)


def test_derivatives_of_an_arm_with_sections_are_differences() -> None:
    """Of a robot that is not compiled, along random directions: given lengths."""
    arm = sr.PccArm(segment_lengths=(0.3,), elastic_sections=1)
    solve = sr.torch.equilibrium(arm, "bending_stiffness", gravity=sr.EARTH_GRAVITY)
    lengths = torch.tensor([[2.8, 3.2, 3.0]], dtype=torch.float64)
    given = [lengths, FORCES[:1], torch.ones(1, dtype=torch.float64)]

    def of_scaled(lengths: Any, forces: Any, scaled: Any) -> Any:
        return solve(0.1 * lengths, 0.5 * forces, scaled * solve.values)

    given = [one.clone().requires_grad_() for one in given]
    assert torch.autograd.gradcheck(of_scaled, given, eps=1e-5, atol=1e-7, rtol=1e-7, check_forward_ad=True, fast_mode=True)


def test_transformations_agree(equilibrium: Any) -> None:
    """A batch by `vmap`, by leading dimensions and row by row; forward and reverse mode."""
    from torch.func import grad, jacfwd, jacrev, vmap

    def height(motors: Any, force: Any, values: Any) -> Any:
        return equilibrium(motors, force, values)[1][..., 2].sum()

    values = equilibrium.values
    whole = [MOTORS.clone().requires_grad_(), FORCES.clone().requires_grad_(), values.clone().requires_grad_()]
    height(*whole).backward()
    by_vmap = vmap(grad(height, argnums=(0, 1, 2)), (0, 0, None))(MOTORS, FORCES, values)
    for place, one in enumerate(whole):
        rows = torch.stack([grad(height, argnums=place)(*row, values) for row in zip(MOTORS, FORCES, strict=True)])
        assert by_vmap[place].numpy() == pytest.approx(rows.numpy(), abs=1e-13)
        assert one.grad.numpy() == pytest.approx((rows if place < 2 else rows.sum(dim=0)).numpy(), abs=1e-13)
    forward, back = (mode(lambda p: equilibrium(MOTORS, FORCES, p)[1])(values) for mode in (jacfwd, jacrev))
    assert forward.numpy() == pytest.approx(back.numpy(), abs=1e-12)


def test_a_load_estimate_inverts_the_equilibrium() -> None:
    """The force by the motor torques has the inverse of the derivatives of the torques by the force."""
    arm = sr.InflatableArm()
    found = sr.solve_equilibrium(sr.load_model(arm), MOTORS[0].numpy(), FORCES[0].numpy())
    estimate, torques = sr.torch.load_estimate(arm, backend="python"), torch.tensor(found.motor_torques)
    assert estimate(MOTORS[0], torques)[2].numpy() == pytest.approx(FORCES[0].numpy(), abs=1e-9)
    by_torques = torch.func.jacrev(lambda one: estimate(MOTORS[0], one)[2])(torques)
    assert by_torques.numpy() @ sr.elastostatic_jacobian(found.model, found)[:3].T == pytest.approx(np.eye(3), abs=1e-9)


def test_what_torch_functions_refuse(equilibrium: Any) -> None:
    with pytest.raises(sr.ParameterError, match=r"torch\.float64 on the CPU"):
        equilibrium(MOTORS.float(), FORCES)
    with pytest.raises(sr.ParameterError, match=r"shape \(\.\.\., 3\)"):
        equilibrium(torch.zeros(4, dtype=torch.float64), FORCES)
    with pytest.raises(sr.ParameterError, match="leading dimensions"):
        equilibrium(MOTORS[:2], torch.zeros((3, 3), dtype=torch.float64))
    one = MOTORS[0].clone().requires_grad_()
    (slope,) = torch.autograd.grad(equilibrium(one, FORCES[0])[1].sum(), one, create_graph=True)
    with pytest.raises(NotImplementedError, match="first derivatives only"):
        slope.sum().backward()


@pytest.mark.system
def test_the_page_of_design_finds_the_arm_that_scipy_finds(tmp_path: Path) -> None:
    """The block of PyTorch in docs/design.md prints what the page says; the others are run by `test_documentation.py`."""
    page = (CHECKOUT / "docs" / "design.md").read_text(encoding="utf-8")
    arm, _, rest = page.partition("## In closed form")
    text = arm + rest[rest.index("## With PyTorch") :]
    marks = [line for line in text.splitlines() if line.startswith("<!-- not run: needs PyTorch; tests/test_torch.py")]
    assert len(marks) == 2
    for mark in marks:
        text = text.replace(mark, "")
    runner = PageRunner("docs/design.md", text, tmp_path)
    runner.run()
    assert runner.ran == 5
