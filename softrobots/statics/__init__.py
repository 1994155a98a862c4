"""Loads, equilibria, stability, branches, sensitivities, load estimation, inverse kinematics, trajectories, workspace."""
