"""Equations of motion of a chain and steps of time, traced: bodies, joints, layout and functions."""
