"""Three pneumatic fingers on a palm around a cylinder, composed by `softrobots.mount`."""

import math

from soft_finger import SoftFinger

import softrobots as sr

AWAY = 0.04  # distance of each finger from the axis of the palm [m]
CYLINDER = 0.015  # radius of the gripped object [m]
FINGERS = {"a_": 0.0, "b_": 2 * math.pi / 3, "c_": -2 * math.pi / 3}  # azimuth of each finger on the palm [rad]

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
    """Displacement of a fingertip with the free position x = `free_tip` by the cylinder [m]; below 0 without contact."""
    return free_tip - (AWAY - cylinder - finger.radius)


def three_fingers(finger: SoftFinger) -> str:
    """URDF text of a palm with three fingers that close towards its axis."""
    hand = PALM
    for prefix, angle in FINGERS.items():
        place = (AWAY * math.cos(angle), AWAY * math.sin(angle), finger.radius)
        hand = sr.mount(hand, "palm", finger, prefix=prefix, xyz=place, rpy=(0, 0, angle + math.pi), name="three_fingers")
    return hand
