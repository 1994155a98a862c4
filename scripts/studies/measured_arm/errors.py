"""Errors of predicted tips, the pose of the base in the frame of the cameras, and the repeatability of the robot itself."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial import KDTree

from softrobots.core.checks import FloatArray
from studies.measured_arm.recordings import Recording


class Pose(NamedTuple):
    """A rigid movement: `rotation @ point + translation`."""

    rotation: FloatArray
    """Shape (3, 3)."""
    translation: FloatArray
    """Shape (3,) [m]."""

    def moved(self, points: FloatArray) -> FloatArray:
        """Points of the base in the frame of the cameras, shape (n, 3) [m]."""
        return np.asarray(points @ self.rotation.T + self.translation)


def offset_errors(predicted: FloatArray, measured: FloatArray) -> FloatArray:
    """Distances after the mean offset of all rows is subtracted, the source's metric, shape (n,) [m]."""
    apart = predicted - measured
    return np.asarray(np.linalg.norm(apart - apart.mean(axis=0), axis=1))


def rms(distances: FloatArray) -> float:
    """Root mean square [m]."""
    return float(np.sqrt(np.mean(np.square(distances))))


def best_pose(predicted: FloatArray, measured: FloatArray) -> Pose:
    """The rigid movement that brings predicted tips nearest to the measured ones in the sense of least squares.

    By the singular value decomposition of their covariance: W. Kabsch, A solution for the best rotation to relate two sets of
    vectors, Acta Crystallographica A32:922-923, 1976. It is the pose of the base, no parameter of the robot.

    Args:
        predicted: Tips in the frame of the base, shape (n, 3) [m].
        measured: The same in the frame of the cameras, shape (n, 3) [m].
    """
    middle, seen = predicted.mean(axis=0), measured.mean(axis=0)
    left, _, right = np.linalg.svd((measured - seen).T @ (predicted - middle))
    mirror = np.diag([1.0, 1.0, np.sign(np.linalg.det(left @ right))])
    rotation = left @ mirror @ right
    return Pose(rotation, seen - rotation @ middle)


class Repeated(NamedTuple):
    """How far apart the tip is at nearly the same commands in different movements."""

    distances: FloatArray
    """Of each row with partners, root mean square of the distances to them over the root of two, shape (rows,) [m]."""
    pairs: int
    """Pairs of rows."""


def repeatability(
    recordings: Sequence[Recording], within: float, *, same_history: bool = False, moved: float = 0.0
) -> Repeated:
    """How well a robot without memory could be predicted at best: the scatter of tips at nearly the same commands.

    The best prediction of two tips at the same commands is their mean. With the correction of a standard deviation of two
    values it misses each by their distance over the root of two.

    Args:
        recordings: The rows; pairs of all of them count that belong to different movements.
        within: Largest difference of the command of a motor [m].
        same_history: Count only pairs whose rows before, in the same movement, are as near: the robot has come the same way.
        moved: Count only rows with a command above this size [m].
    """
    pulls = np.concatenate([recording.pulls for recording in recordings])
    tips = np.concatenate([recording.tips for recording in recordings])
    blocks = np.array([block for recording in recordings for block in recording.blocks])
    first, second = KDTree(pulls).query_pairs(within, p=np.inf, output_type="ndarray").T
    large = np.abs(pulls).max(axis=1) >= moved
    chosen = (blocks[first] != blocks[second]) & large[first] & large[second]
    if same_history:
        follows = np.concatenate([[False], blocks[1:] == blocks[:-1]])
        chosen &= follows[first] & follows[second] & (np.abs(pulls[first - 1] - pulls[second - 1]).max(axis=1) <= within)
    ends = np.concatenate([[first[chosen], second[chosen]], [second[chosen], first[chosen]]], axis=1)
    squares = np.square(np.linalg.norm(tips[ends[0]] - tips[ends[1]], axis=1))
    sums, counts = (np.bincount(ends[0], weights, len(tips)) for weights in (squares, None))
    return Repeated(np.asarray(np.sqrt(sums[counts > 0] / counts[counts > 0] / 2.0)), int(chosen.sum()))
