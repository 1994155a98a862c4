"""Synthetic measurements of an inflatable arm for docs/your_robot.md; `python docs/examples/your_robot/measure.py` writes them.

No robot was measured. An arm that is not as designed is solved in 20 poses, each under three weights, and seen by a camera
that is not where it is thought to be: the base stands a little off and turned, the motors' zeros are off, the ball is not at
the tip. The camera errs by 0.8 mm in each axis, the motors stop within 0.5 mrad of a pose, and in one row the camera has
mistaken something else for the ball.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import pinocchio as pin

import softrobots as sr

TRUE_ARM = sr.InflatableArm(stiffness=(158.0, 186.0))
"""The arm as it really is [N m/rad]."""
BASE_POSITION, BASE_ROTATION = (0.012, -0.008, 0.004), (0.006, -0.004, 0.020)
"""Pose of its base in the frame of the camera [m, rotation vector in rad]."""
MOTOR_OFFSETS = (0.0, 0.008, -0.012)
"""True minus commanded motor angles [rad]; of the first motor, which turns about the vertical, the base's turn tells."""
BALL = (0.0155, -0.0005, 0.041)
"""Place of the ball in the frame of the tip [m]; a calliper said (0.015, 0, 0.040)."""
CAMERA, STOPPING = 0.8e-3, 0.5e-3
"""Standard deviations of the camera in each axis [m], and of where a motor stops [rad]."""
GRAVITY = (0.0, 0.0, -9.81)
"""Gravity in the frame of the camera, which stands level [m/s^2]."""
MASSES = (0.0, 0.5, 1.0)
"""Weights that are hung at the tip in turn [kg]."""


def measured_rows() -> list[str]:
    """Lines of the file: what was commanded and hung, and where the camera saw the ball."""
    random = np.random.default_rng(12)
    arm, turn = sr.load_model(TRUE_ARM), np.asarray(pin.exp3(np.array(BASE_ROTATION)))
    gravity = turn.T @ GRAVITY
    lines = ["pose,shoulder_deg,lift_deg,elbow_deg,hung_g,ball_x_mm,ball_y_mm,ball_z_mm"]
    for pose in range(20):
        commanded = np.round(np.degrees(random.uniform((-1.2, -0.5, -1.4), (1.2, 1.1, 0.6))))
        motors = np.radians(commanded) + MOTOR_OFFSETS + random.normal(0.0, STOPPING, 3)
        for mass in MASSES:
            state = sr.solve_equilibrium(arm, motors, mass * gravity, gravity=gravity)
            tip = state.transform_tip_to_world
            seen = turn @ (tip.translation + tip.rotation @ BALL) + BASE_POSITION + random.normal(0.0, CAMERA, 3)
            if (pose, mass) == (8, 0.5):
                seen += (0.0, 0.021, -0.017)
            numbers = [*(f"{angle:.0f}" for angle in commanded), f"{1e3 * mass:.0f}", *(f"{1e3 * x:.1f}" for x in seen)]
            lines.append(",".join([f"session{pose // 5 + 1}_pose{pose % 5 + 1}", *numbers]))
    return lines


def main() -> None:
    """Write the file."""
    parser = argparse.ArgumentParser(description="Write the synthetic measurements of docs/your_robot.md.")
    parser.add_argument("-o", "--output", type=Path, default=Path(__file__).with_name("poses.csv"), help="file (%(default)s)")
    parser.parse_args().output.write_text("\n".join([*measured_rows(), ""]), encoding="utf-8")


if __name__ == "__main__":
    main()
