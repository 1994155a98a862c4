"""Generated code of a robot: for Python, as C for control loops, as JavaScript for pages."""

from __future__ import annotations

import re
from typing import Any, NamedTuple

from softrobots.compiled.chain.unknowns import Unknowns
from softrobots.compiled.program.generated_module import make_given_program, make_program
from softrobots.compiled.program.motion_program import make_motion_program
from softrobots.compiled.run.backends import make_run
from softrobots.compiled.trace.numbers import TableInputs
from softrobots.core.checks import FloatArray, positive_integer
from softrobots.core.errors import ParameterError
from softrobots.dynamics.step_control import order_of_steps
from softrobots.model.soft_model import SoftModel


class SharedCode(NamedTuple):
    """Code of looped chains of one structure, which takes their numbers as inputs, for one of them."""

    unknowns: Unknowns
    """The chain that it is made for."""
    inputs: TableInputs
    """The numbers that are inputs."""
    numbers: FloatArray
    """Those of the robot, shape (k,)."""
    runs: dict[Any, Any]
    """The code, filled on first use."""


class CompiledCode:
    """The generated code of a robot; see `softrobots.compiled.run.compiled_model.CompiledModel`."""

    def __init__(
        self, model: SoftModel, backend: str, locked_strains: tuple[str, ...], shared: SharedCode | None = None
    ) -> None:
        """Read the robot; `shared` is code that takes its numbers as inputs."""
        self._model, self._backend = model, backend
        self._chain = model.chain()
        self._unknowns = Unknowns(self._chain, locked_strains)
        self._inputs = None if shared is None else shared.inputs
        self._made_for = self._unknowns if shared is None else shared.unknowns
        self._runs: dict[Any, Any] = {} if shared is None else shared.runs

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle as the robot and its options; the other process compiles it again, or finds the code in its cache."""
        return type(self), (self._model, self._backend, self._unknowns.locked)

    def __repr__(self) -> str:
        """The robot and the back end."""
        return f"{type(self).__name__}({self._chain.name!r}, backend={self._backend!r})"

    @property
    def model(self) -> SoftModel:
        """The robot."""
        return self._model

    @property
    def backend(self) -> str:
        """The back end: "numba" or "python"."""
        return self._backend

    @property
    def unknowns(self) -> Unknowns:
        """Its chain and unknown strains."""
        return self._unknowns

    def source(self, *, gravity: bool = False, lanes: bool = False, motion: bool = False) -> str:
        """Return the generated code as Python runs it.

        Args:
            gravity: Return the code for robots with weight.
            lanes: Append the functions for batches.
            motion: Return the code of motion instead, which always has gravity.

        Raises:
            ParameterError: If motion is asked for and that of its actuators is not compiled.
        """
        program = make_motion_program(self._unknowns) if motion else self._run(gravity).program
        return str(program.text + ("\n\n" + program.lane_text if lanes else ""))

    def c_source(
        self,
        *,
        gravity: bool = False,
        prefix: str = "softrobots",
        poses: bool = False,
        motion: bool = False,
        order: int = 2,
    ) -> str:
        """Return the generated code as freestanding C99: one file without libraries, allocation or state, for a control loop.

        Every function works on an array of doubles that the caller owns. The comment at the head of the file lists inputs and
        results with their places and units, and the meaning of each status. `settle` finds equilibria of every robot;
        `estimate`, `reach` and `follow` exist for unrolled chains; `motion_step` takes a step of time.

        Args:
            gravity: Return the code for robots with weight.
            prefix: Beginning of every name, before an underscore.
            poses: Return the code whose targets are poses.
            motion: Return the code of motion instead of that of statics; it always has gravity.
            order: Order of the steps of motion: 2, or 4 for motors that stand still.

        Raises:
            ParameterError: If the prefix is not an identifier of C, the robot cannot have poses as targets, or motion is asked
                for and that of its actuators is not compiled.
        """
        from softrobots.compiled.translate.c import to_c

        if not isinstance(prefix, str) or not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", prefix):
            raise ParameterError("prefix", prefix, "ASCII letters, digits and underscores, a letter first")
        order_of_steps(order, None, self._model, still=True)
        program = make_motion_program(self._unknowns, order=order) if motion else self._run(gravity, poses).program
        return to_c(program.text, prefix=f"{prefix}_", exported=program.entry_points)

    def js_source(self, *, gravity: bool = True, points: int = 4) -> str:
        """Return a solver for a page, in JavaScript: one script without imports, that defines the function `makeSolver`.

        `makeSolver()` returns an object with

        - `name`; `actuators`, each `{name, unit, lower, upper, relaxed}` (a limit that is not there is null); `springs`, each
          `{name, unit}`; `statuses`, by number `{name, text}`; `frames`, each `{name, kind, share}`;
        - `solve({motors, force, gravity, from})`. Motors [rad, m, N or Pa] are an array or an object by name. Force [N] and
          gravity [m/s^2], world axes, may be left out: none. `from` is an earlier result near which the search starts, and of a
          robot with dry friction (`rubs` is true) the state before, whose friction remembers; without it nothing has moved.

        The result of `solve` has `status` and `statusText` (see `Status`), `tip` [m], `springs` (as `Equilibrium.q_springs`),
        `residual` [N m], `minPivot` (the smallest pivot of the tangent stiffness, by its spring's own) and `placements`: for
        each of `frames` a rotation matrix, row by row, and a position [m] in the world. Frames are those of joints,
        Pinocchio's, of points along sections at a share of their length, and the tip. `links` has for each inflated link
        `{name, moment, axialForce, slackMargin, wrinklingMargin}` as `Equilibrium.link_limits`, and `tensions` [N] are
        those of `Equilibrium.muscle_forces`. Other numbers than finite ones throw a TypeError. With the status `NOT_A_NUMBER`
        the other numbers mean nothing.

        Args:
            gravity: Write the code for robots with weight; it solves weightless ones, too.
            points: Number of placements along a section.

        Raises:
            ParameterError: If `points` is not positive.
        """
        from softrobots.compiled.browser.script import script

        positive_integer("points", points, 1000)
        return script(self._model, self._unknowns, self._run(gravity).program, gravity=gravity, points=points)

    def _run(self, weight: bool, poses: bool = False) -> Any:
        """Return the code with or without gravity, for positions or poses as targets, generated on first use.

        Raises:
            ParameterError: If the robot cannot have poses as targets.
        """
        run = self._runs.get((weight, poses))
        if run is None:
            if poses and not (self._unknowns.is_unrolled and self._chain.n_motors >= 6):
                kind = f"{self._chain.n_motors} motors and {len(self._chain.elements)} joints and sections"
                requirement = f"positions for this robot, it has {kind}; poses need six motors and a chain that is unrolled"
                raise ParameterError("targets", "poses", f"{requirement} (softrobots.solve_ik takes poses of every robot)")
            program = make_program(self._made_for, weight=weight, poses=poses, inputs=self._inputs)
            run = self._runs[weight, poses] = make_run(program, self._backend)
        return run

    def given_run(self, weight: bool) -> Any:
        """Return the code of the response of a looped chain to given loads and motions, generated on first use."""
        if ("given", weight) not in self._runs:
            program = make_given_program(self._made_for, weight=weight, inputs=self._inputs)
            self._runs["given", weight] = make_run(program, self._backend)
        return self._runs["given", weight]
