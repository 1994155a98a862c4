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


# Degrees, classes, a nested frame, `ref` and `springref` on a hinge and a slide, anchors beside the body, three joints a body.
ARM = """
<mujoco model="third party">
  <option gravity="0 0 -9.81"/>
  <default>
    <joint damping="2" armature="0.1"/> <geom density="900"/>
    <default class="stiff"> <joint stiffness="30"/> <geom rgba="1 0 0 1"/> </default>
    <default class="soft"> <joint stiffness="4" springref="10"/> </default>
  </default>
  <worldbody>
    <geom type="plane" size="1 1 .1"/>
    <frame pos="0.1 0.2 0.3" euler="10 20 30">
      <body name="base" pos="0 0 1" childclass="stiff">
        <geom type="box" size=".1 .1 .05"/>
        <body name="upper" pos="0 0 .1" euler="0 30 0">
          <joint name="yaw" axis="0 0 1" stiffness="0" range="-180 180" frictionloss="0.1" actuatorfrcrange="-40 30"/>
          <joint name="pitch" axis="0 1 0.2" pos=".02 .01 .03" ref="15" springref="25"/>
          <geom type="capsule" fromto="0 0 0 .3 0 0" size=".02"/>
          <body name="fore" pos=".3 0 0" axisangle="1 0 0 40">
            <joint name="bend" axis="0 1 0" class="soft"/>
            <joint name="turn" axis="0 0 1" class="soft" range="-90 90" pos="-.01 0 .02"/>
            <joint name="slide" type="slide" axis="1 0 0.3" stiffness="300" ref=".05" springref=".07"/>
            <geom type="cylinder" fromto="0 0 0 .25 0 0" size=".015"/>
            <geom type="ellipsoid" size=".01 .02 .03" pos=".1 0 0"/>
            <site name="tip" pos=".25 0 .02" euler="0 0 90"/>
            <body name="hand" pos=".25 0 0" gravcomp="0">
              <joint name="h1" axis="1 0 0" stiffness="3"/>
              <joint name="h2" axis="0 1 0" stiffness="2"/>
              <joint name="h3" axis="0 0 1" stiffness="1"/>
              <geom size=".04"/>
              <body name="finger" pos=".06 .01 0"> <geom size=".01"/> </body>
            </body>
          </body>
        </body>
      </body>
    </frame>
  </worldbody>
  <actuator> <position name="servo" joint="yaw" kp="100"/> <motor joint="bend"/> </actuator>
</mujoco>
"""
