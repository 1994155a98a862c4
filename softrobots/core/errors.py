"""Errors of the package, derived from `SoftRobotsError`.

Each error states the value, the requirement and the alternatives, and carries the same facts as attributes. Each also derives
from the built-in exception that a caller would expect.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

_LONGEST = 120  # characters of a value in an error


class SoftRobotsError(Exception):
    """Base of every error of this package."""

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle as message and attributes, so that worker processes can return errors."""
        return _rebuild, (type(self), self.args, self.__dict__)

    def __str__(self) -> str:
        """Return the message itself, which built-in errors may quote or number."""
        return str(self.args[0]) if self.args else ""


class ParameterError(SoftRobotsError, ValueError):
    """An invalid value: wrong shape, not finite, out of range, unknown option.

    Attributes:
        field: Name of the parameter.
        value: The invalid value.
        requirement: What it must be.
    """

    def __init__(self, field: str, value: Any, requirement: str) -> None:
        """Create the error `<field> = <value>: <field> must be <requirement>`."""
        super().__init__(f"{field} = {short(value, _LONGEST)}: {field} must be {requirement}")
        self.field = field
        self.value = value
        self.requirement = requirement


class DescriptionError(SoftRobotsError, ValueError):
    """A robot description (xacro, URDF, MJCF or SDF) that cannot be generated or read."""


class NameNotFound(SoftRobotsError, LookupError):
    """An unknown name of a joint, frame or option.

    Attributes:
        kind: What the name stands for, e.g. "frame".
        name: The unknown name.
        available: The names that exist.
        hint: The question whether the nearest of them was meant, for the message; empty if none is near.
    """

    def __init__(self, kind: str, name: str, available: Iterable[str], *, lines: Iterable[str] = ()) -> None:
        """Create the error with a list of the available names, or with `lines` that describe them."""
        self.kind = kind
        self.name = name
        self.available = tuple(available)
        near = difflib.get_close_matches(str(name), self.available, n=1)
        self.hint = f" (did you mean {near[0]!r}?)" if near else ""
        listed = "".join(f"\n  {line}" for line in lines) or f" {', '.join(self.available) or 'none'}"
        super().__init__(f"no {kind} is called {name!r}{self.hint}; available:{listed}")


class FieldNotFound(NameNotFound, TypeError):
    """An argument of a robot that is none of its parameters."""


class StraightTube(SoftRobotsError, ValueError):
    """A tube without helix radius: contraction 1 and angle 0, up to rounding."""


class SelfIntersection(SoftRobotsError, ValueError):
    """A helix whose tube would run into itself.

    Attributes:
        contact: The `softrobots.helix.SelfContact` with place and amount.
    """

    def __init__(self, message: str, *, contact: Any) -> None:
        super().__init__(message)
        self.contact = contact


class NotConverged(SoftRobotsError, RuntimeError):
    """An iteration that did not converge.

    Attributes:
        best: The best iterate: an `Equilibrium`, `LoadEstimate` or `IkSolution` that does not meet the tolerance, or what there
            is of a `Motion` or a batch.
        residual: Its residual, in the unit given in the message.
        iterations: Number of iterations.
    """

    def __init__(self, message: str, *, best: Any, residual: float, iterations: int) -> None:
        super().__init__(message)
        self.best = best
        self.residual = residual
        self.iterations = iterations


class EquilibriumNotFound(NotConverged):
    """No static equilibrium was found.

    `best` is an `Equilibrium` above the tolerance, or the `ImposedDisplacement` up to the last displacement that was reached.
    """


class LoadNotFound(NotConverged):
    """No load explains the motor torques; `best` is a `LoadEstimate` above the tolerance."""


class TargetUnreachable(NotConverged):
    """No motor coordinates bring the loaded tip to the target.

    `best` is the `IkSolution` nearest to the target, `residual` its distance [m].
    """


class NeutralEquilibrium(SoftRobotsError, ArithmeticError):
    """An equilibrium with singular tangent stiffness: neither stable nor unstable, and without derivatives."""


class NoCriticalLoad(SoftRobotsError, RuntimeError):
    """The equilibrium path is stable up to the largest load considered.

    Attributes:
        max_force: That load [N].
    """

    def __init__(self, message: str, *, max_force: float) -> None:
        super().__init__(message)
        self.max_force = max_force


class OutputError(SoftRobotsError, OSError):
    """A result cannot be written."""


class OutputExists(OutputError, FileExistsError):
    """The output exists already: a file, or a folder that is not empty."""


class FileFormatError(SoftRobotsError, ValueError):
    """A file that cannot be read: results, waypoints, parameters, measurements."""


class ClusterError(SoftRobotsError, RuntimeError):
    """A cluster of worker processes cannot be reached, or fails."""


class ViewerError(SoftRobotsError, RuntimeError):
    """The browser view cannot be served."""


class MissingDependency(SoftRobotsError, ImportError):
    """A package of an optional extra is not installed."""

    def __init__(self, package: str, extra: str) -> None:
        """Create the error with the command that installs the extra."""
        super().__init__(f"{package} is not installed; it is part of an extra: pip install 'softrobots[{extra}]'")

    @classmethod
    @contextmanager
    def of_imports(cls, package: str, extra: str) -> Iterator[None]:
        """Raise this error if an import in the block fails."""
        try:
            yield
        except ImportError as error:
            raise cls(package, extra) from error


def _rebuild(kind: type[SoftRobotsError], arguments: tuple[Any, ...], attributes: dict[str, Any]) -> SoftRobotsError:
    error = kind.__new__(kind, *arguments)
    error.args = arguments
    error.__dict__.update(attributes)
    return error


def short(value: Any, longest: int = 60) -> str:
    """Return the `repr` of a value in one line, of a long one its beginning."""
    try:
        text = repr(value).replace("\n", " ")
    except Exception:  # too deep a nesting, an integer of too many digits, an object of the caller
        text = f"<{type(value).__name__}>"
    return text if len(text) <= longest else f"{text[: longest - 3]}..."
