"""The tip along a path of targets: exact steps between waypoints, and the closed loop of the paper."""
