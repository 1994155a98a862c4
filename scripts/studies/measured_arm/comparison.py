"""Predicted tips beside the measured ones, in the frame of the cameras."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from studies.measured_arm.errors import Pose, offset_errors, rms
from studies.measured_arm.recordings import Recording


@dataclass(frozen=True, eq=False)
class Compared:
    """A set of rows and the tips that a model predicts for them."""

    recording: Recording
    """What was measured."""
    tips: FloatArray
    """Predicted in the frame of the base, shape (n, 3) [m]."""
    pose: Pose
    """Of the base in the frame of the cameras."""

    @property
    def posed(self) -> FloatArray:
        """Predicted in the frame of the cameras, shape (n, 3) [m]."""
        return self.pose.moved(self.tips)

    @property
    def errors(self) -> FloatArray:
        """Distances from the measured tips, shape (n,) [m]."""
        return np.asarray(np.linalg.norm(self.posed - self.recording.tips, axis=1))

    def summary(self) -> dict[str, float]:
        """Root mean squares: by the source's metric, with the pose of the base, with camera and base taken for the same [m]."""
        raw = np.linalg.norm(self.tips - self.recording.tips, axis=1)
        offset = offset_errors(self.tips, self.recording.tips)
        return {"offset_m": rms(offset), "posed_m": rms(self.errors), "raw_m": rms(raw)}

    def by_family(self) -> Mapping[str, dict[str, Any]]:
        """Errors with the pose of the base, by family of movements."""
        names = np.array(self.recording.families)
        result = {}
        for name in dict.fromkeys(names.tolist()):
            errors = self.errors[names == name]
            parts = zip(("median_m", "p95_m", "largest_m"), np.percentile(errors, (50.0, 95.0, 100.0)).tolist(), strict=True)
            result[name] = {"rows": len(errors), "rms_m": rms(errors), **dict(parts)}
        return result
