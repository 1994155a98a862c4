"""Robots of other people: URDF without our tags."""

from __future__ import annotations

from types import ModuleType

INERTIAL = '<inertial><mass value="0.5"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial>'


LIMIT = '<limit lower="-2" upper="2" effort="10" velocity="1"/>'


def mass_error(mujoco: ModuleType) -> float:
    """Relative error of MuJoCo's mass matrices: version 3 turns moments onto their axes to seven digits, version 4 to all."""
    return 1e-12 if int(mujoco.__version__.partition(".")[0]) >= 4 else 1e-6


def joint(
    name: str,
    parent: str,
    child: str,
    axis: str,
    kind: str = "revolute",
    xyz: str = "0.3 0 0",
    rpy: str = "0.1 0.2 0.3",
) -> str:
    limit = "" if kind == "continuous" else LIMIT
    return (
        f'<joint name="{name}" type="{kind}"><origin xyz="{xyz}" rpy="{rpy}"/><parent link="{parent}"/>'
        f'<child link="{child}"/><axis xyz="{axis}"/>{limit}</joint><link name="{child}">{INERTIAL}</link>'
    )


# A continuous shoulder, an elbow, a sprung wrist and a sprung slider; a side branch with a joint of its own.
BRANCHED = (
    f'<robot name="foreign"><link name="base">{INERTIAL}</link>'
    + joint("shoulder", "base", "upper", "0 0 1", "continuous")
    + joint("elbow", "upper", "lower", "0 1 0")
    + joint("wrist", "lower", "hand", "0 0 1")
    + joint("slider", "hand", "finger", "1 0 0", "prismatic")
    + joint("gripper", "upper", "side", "0 1 0", xyz="0 0.2 0")
    + "</robot>"
)
SPRINGS = {"wrist": (20.0, 0.1), "slider": 800.0}
