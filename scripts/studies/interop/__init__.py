"""Other robotics tools, run from here: what they make of our files, compared with Pinocchio.

Only the command line and the scripts need these modules; each tool is imported when it is asked for.
"""
