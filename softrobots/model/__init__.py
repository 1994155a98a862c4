"""`SoftModel`: Pinocchio, joints and their roles, elastic coordinates, spring laws, actuators, and the loader."""
