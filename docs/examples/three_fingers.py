"""Three pneumatic fingers on a palm around a cylinder: robots put together by `softrobots.mount`."""

import math

from soft_finger import SoftFinger

import softrobots as sr

AWAY = 0.04  # from the axis of the palm to each finger [m]
CYLINDER = 0.015  # radius of what is gripped [m]
FINGERS = {"a_": 0.0, "b_": 2 * math.pi / 3, "c_": -2 * math.pi / 3}  # where each stands around the palm [rad]

PALM = f"""<robot name="palm">
  <link name="palm">
    <inertial><mass value="0.2"/><inertia ixx="1e-4" ixy="0" ixz="0" iyy="1e-4" iyz="0" izz="2e-4"/></inertial>
    <visual>
      <origin xyz="0 0 -0.01"/><geometry><cylinder radius="0.055" length="0.02"/></geometry>
      <material name="palm"><color rgba="0.35 0.37 0.40 1"/></material>
    </visual>
    <visual>
      <origin xyz="0 0 0.09"/><geometry><cylinder radius="{CYLINDER}" length="0.1"/></geometry>
      <material name="object"><color rgba="0.62 0.64 0.66 1"/></material>
    </visual>
  </link>
</robot>"""


def way_to_close(finger: SoftFinger, free_tip: float, cylinder: float = CYLINDER) -> float:
    """How far the cylinder keeps back a fingertip that would be at x = `free_tip` without it [m]; below 0: no touch."""
    return free_tip - (AWAY - cylinder - finger.radius)


def three_fingers(finger: SoftFinger) -> str:
    """URDF text of a palm with three fingers that close towards its axis."""
    hand = PALM
    for prefix, angle in FINGERS.items():
        place = (AWAY * math.cos(angle), AWAY * math.sin(angle), finger.radius)
        hand = sr.mount(hand, "palm", finger, prefix=prefix, xyz=place, rpy=(0, 0, angle + math.pi), name="three_fingers")
    return hand
