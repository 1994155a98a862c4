"""Lengths of muscles along sections and hinges, written plainly: no code of the model or of the compiled solvers."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.description.urdf_tags import RobotTags


class PlainMuscles:
    """The muscles of a robot."""

    def __init__(self, tags: RobotTags, names: Sequence[str]) -> None:
        """Take the description and the names of all strains, springs and then sections."""
        self._tags, self._names = tags, list(names)
        self._rest = np.array([muscle.rest_length for muscle in tags.muscles])
        self.rows = np.zeros((len(tags.muscles), len(names)))
        """Derivative of the lengths without twist by the strains, shape (n_muscles, n_strains)."""
        for row, muscle in zip(self.rows, tags.muscles, strict=True):
            arms = {
                "bend_x": muscle.distance * math.sin(muscle.azimuth),
                "bend_y": -muscle.distance * math.cos(muscle.azimuth),
                "stretch": 1.0,
            }
            for tag in tags.sections:
                for strain, arm in arms.items() if tag.segment in muscle.segments else ():
                    row[self._names.index(f"{tag.name}_{strain}")] = arm
            for lumped in tags.lumped_sections:
                for strain, arm in arms.items() if lumped.segment in muscle.segments else ():
                    if strain in lumped.joints:
                        row[self._names.index(lumped.joints[strain])] = arm

    def tensions(self, lengths: FloatArray, given: FloatArray) -> FloatArray:
        """Return the tensions at lengths and at what is given, tensions or lengths at the motors, shape (n, n_muscles) [N]."""
        tensions = np.array(given)
        for m, muscle in enumerate(self._tags.muscles):
            if muscle.kind == "elastic":
                tensions[:, m] = np.maximum(0.0, muscle.pretension + muscle.stiffness * (lengths[:, m] - given[:, m]))
        return tensions

    def at(self, strains: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the lengths, shape (n, n_muscles), and their derivatives by the strains, shape (n, n_muscles, n_strains).

        A helix around the backbone in every section; beside a hinge the square of the twist over twice the length is added.
        """
        lengths = self._rest + strains @ self.rows.T
        slopes = np.tile(self.rows, (len(strains), 1, 1))
        for m, muscle in enumerate(self._tags.muscles):
            for tag in self._tags.sections:
                if tag.segment in muscle.segments:
                    first = self._names.index(f"{tag.name}_bend_x")
                    here, arms = slice(first, first + 4), self.rows[m, first : first + 4]
                    along, across = tag.length + strains[:, here] @ arms, muscle.distance * strains[:, first + 2]
                    size = np.hypot(along, across)
                    lengths[:, m] += size - along
                    slopes[:, m, here] = (along / size)[:, None] * arms
                    slopes[:, m, first + 2] = muscle.distance * across / size
            for lumped in self._tags.lumped_sections:
                if lumped.segment in muscle.segments and "twist" in lumped.joints:
                    place, rest = self._names.index(lumped.joints["twist"]), lumped.rest[2] * lumped.length
                    twist = strains[:, place] + rest
                    lengths[:, m] += muscle.distance**2 * (twist**2 - rest**2) / (2.0 * lumped.length)
                    slopes[:, m, place] = muscle.distance**2 * twist / lumped.length
        return lengths, slopes
