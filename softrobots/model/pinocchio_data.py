"""Pinocchio's working memory for a robot, one for each thread and gravity; its numbering; and the mass matrix."""

from __future__ import annotations

import threading
from functools import cached_property
from typing import Any

import numpy as np
import pinocchio as pin

from softrobots.core.checks import FloatArray, read_only
from softrobots.core.errors import DescriptionError

MAX_DOF = 300
"""Largest number of coordinates: Pinocchio's workspace takes seconds and 0.9 GB there, eight times that at twice as many."""

_CACHED_GRAVITIES = 8  # copies of Pinocchio's model in each thread


class PinocchioData(threading.local):
    """Pinocchio data of a robot, allocated by each thread on first use and freed when the thread ends.

    Pinocchio keeps gravity in its model, so that each gravity needs a copy of the model; the data is shared by all gravities,
    because no function of the statics reads what an earlier call left there.
    """

    def __init__(self, model: Any) -> None:
        """Take a `pinocchio.Model`."""
        self._model = model
        self._pairs: dict[Any, tuple[Any, Any]] = {}

    def at(self, gravity: tuple[float, float, float] | None) -> tuple[Any, Any]:
        """Return model and data of the calling thread; see `SoftModel.workspace`."""
        if gravity not in self._pairs:
            self._pairs[gravity] = self._pair(gravity)
        return self._pairs[gravity]

    @cached_property
    def frame_ids(self) -> dict[str, int]:
        """Pinocchio's number of each frame by its name; a link goes before a joint of the same name."""
        frames = [(frame.name, number, frame.type) for number, frame in enumerate(self._model.frames)]
        links = {name: number for name, number, kind in frames if kind == pin.FrameType.BODY}
        return {name: number for name, number, _ in frames} | links

    @cached_property
    def circles(self) -> tuple[tuple[int, int], ...]:
        """Places in velocity and configuration of the joints that Pinocchio places on a circle, as cosine and sine."""
        return tuple((joint.idx_v, joint.idx_q) for joint in list(self._model.joints)[1:] if joint.nq == 2)

    @cached_property
    def q_indices(self) -> Any:
        """Place in the configuration of each place in the velocity."""
        return np.array([joint.idx_q for joint in list(self._model.joints)[1:]], dtype=np.intp)

    @cached_property
    def _upper(self) -> FloatArray:
        """Mask of the upper triangle with half of the diagonal, shape (nv, nv)."""
        ones = np.ones((self._model.nv, self._model.nv))
        return read_only(0.5 * (np.triu(ones) + np.triu(ones, 1)))

    def mass_matrix(self, q: FloatArray) -> FloatArray:
        """Return the mass matrix at a configuration, shape (nq,), per velocity, shape (nv, nv) [kg m^2, kg m, kg].

        Raises:
            DescriptionError: If the robot has more than `MAX_DOF` coordinates.
        """
        model, data = self.at(None)
        upper = pin.crba(model, data, q) * self._upper  # it fills the upper triangle
        return np.asarray(upper + upper.T)

    def _pair(self, gravity: tuple[float, float, float] | None) -> tuple[Any, Any]:
        if gravity is None:
            if self._model.nv > MAX_DOF:
                raise DescriptionError(
                    f"{self._model.name} has {self._model.nv} coordinates; Pinocchio's workspace is allocated for at most "
                    f"{MAX_DOF} (use softrobots.compile for longer chains)"
                )
            return self._model, self._model.createData()
        _, data = self.at(None)
        model = self._model.copy()
        model.gravity.linear = np.array(gravity)
        cached = [key for key in self._pairs if key is not None]
        if len(cached) >= _CACHED_GRAVITIES:
            del self._pairs[cached[0]]
        return model, data
