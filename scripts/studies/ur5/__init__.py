"""The characterisation bench of [Troise 2021] in simulation: a UR5 pushes a clamped inflated link."""
