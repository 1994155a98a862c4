"""What stands around a robot: obstacles, the capsules of the robot, and the gaps between them."""
