"""Every error that softrobots raises on purpose, in one hierarchy.

Each error says what came, what was required and what is available, and carries the same facts as attributes. All derive
from `SoftRobotsError`; each also derives from the built-in exception that a caller would expect.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from typing import Any


class SoftRobotsError(Exception):
    """Base of every error of this package."""

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle as message and attributes, so that an error crosses from a worker process whole."""
        return _rebuild, (type(self), self.args, self.__dict__)


class ParameterError(SoftRobotsError, ValueError):
    """A value that is not acceptable: wrong shape, not finite, out of range, unknown option.

    Attributes:
        field: Name of the parameter.
        value: What came.
        requirement: What was required.
    """

    def __init__(self, field: str, value: Any, requirement: str) -> None:
        """Say that `field` came as `value` although `requirement` was required."""
        super().__init__(f"{field} = {_short(value)}: {field} must be {requirement}")
        self.field = field
        self.value = value
        self.requirement = requirement


class DescriptionError(SoftRobotsError, ValueError):
    """A robot description (xacro or URDF) that cannot be made or read."""


class NameNotFound(SoftRobotsError, LookupError):
    """A joint, frame or option name that the robot does not have.

    Attributes:
        kind: What the name stands for, e.g. "frame".
        name: The name that came.
        available: The names that exist.
    """

    def __init__(self, kind: str, name: str, available: Iterable[str], *, lines: Iterable[str] = ()) -> None:
        """Say that no `kind` is called `name`, and which ones there are: by name, or in `lines` that tell more of each."""
        self.kind = kind
        self.name = name
        self.available = tuple(available)
        near = difflib.get_close_matches(str(name), self.available, n=1)
        hint = f" (did you mean {near[0]!r}?)" if near else ""
        listed = "".join(f"\n  {line}" for line in lines) or f" {', '.join(self.available) or 'none'}"
        super().__init__(f"no {kind} is called {name!r}{hint}; available:{listed}")

    def __str__(self) -> str:
        """Return the message itself (LookupError's children may quote it)."""
        return str(self.args[0])


class StraightTube(SoftRobotsError, ValueError):
    """A tube that is not bent at all: angle 0 and contraction 1, or so near that no helix radius can be told."""


class SelfIntersection(SoftRobotsError, ValueError):
    """A helix whose tube would run into itself.

    Attributes:
        contact: The `softrobots.helix.SelfContact` that tells where and by how much.
    """

    def __init__(self, message: str, *, contact: Any) -> None:
        """Say what touches what, and keep the finding."""
        super().__init__(message)
        self.contact = contact


class NotConverged(SoftRobotsError, RuntimeError):
    """An iteration that ended without an answer; it carries the best iterate.

    Attributes:
        best: The best iterate: an `Equilibrium`, `LoadEstimate` or `IkSolution` that does not meet the tolerance.
        residual: Its residual, in the unit that the message states.
        iterations: How many iterations were spent.
    """

    def __init__(self, message: str, *, best: Any, residual: float, iterations: int) -> None:
        """Say what did not converge and keep the best iterate."""
        super().__init__(message)
        self.best = best
        self.residual = residual
        self.iterations = iterations


class EquilibriumNotFound(NotConverged):
    """No static equilibrium was reached.

    `best` is an `Equilibrium` above the tolerance, or the `ImposedDisplacement` as far as the displacement could be followed.
    """


class LoadNotFound(NotConverged):
    """No load explains the motor torques; `best` is a `LoadEstimate` above the tolerance."""


class TargetUnreachable(NotConverged):
    """No motor angles bring the loaded tip to the target.

    `best` is the `IkSolution` nearest to the target, `residual` its distance [m].
    """


class NeutralEquilibrium(SoftRobotsError, ArithmeticError):
    """An equilibrium that is neither stable nor unstable: its tangent stiffness is singular, so it has no derivative."""


class NoCriticalLoad(SoftRobotsError, RuntimeError):
    """The equilibrium path stays stable up to the largest load that was tried.

    Attributes:
        max_force: That load [N].
    """

    def __init__(self, message: str, *, max_force: float) -> None:
        """Say how far the path was followed."""
        super().__init__(message)
        self.max_force = max_force


class OutputError(SoftRobotsError, OSError):
    """A result cannot be written."""

    def __str__(self) -> str:
        """Return the message itself."""
        return str(self.args[0])


class OutputExists(OutputError, FileExistsError):
    """A file or a folder that is not empty stands where a result would be written."""


class FileFormatError(SoftRobotsError, ValueError):
    """A results or waypoint file that cannot be read."""


class ClusterError(SoftRobotsError, RuntimeError):
    """A cluster of worker processes cannot be reached, or does not do its work."""


class ViewerError(SoftRobotsError, RuntimeError):
    """The browser view cannot be served."""


class MissingDependency(SoftRobotsError, ImportError):
    """A package of an optional extra is needed and not installed."""

    def __init__(self, package: str, extra: str) -> None:
        """Say what to type."""
        super().__init__(f"{package} is not installed; it is part of an extra: pip install 'softrobots[{extra}]'")


def _rebuild(kind: type[SoftRobotsError], arguments: tuple[Any, ...], attributes: dict[str, Any]) -> SoftRobotsError:
    made = kind.__new__(kind, *arguments)
    made.args = arguments
    made.__dict__.update(attributes)
    return made


def _short(value: Any, limit: int = 120) -> str:
    try:
        text = repr(value).replace("\n", " ")
    except Exception:  # nested too deeply, an integer of more digits than Python writes, an object of the caller
        text = f"<{type(value).__name__}>"
    return text if len(text) <= limit else text[: limit - 3] + "..."
