"""Robot descriptions: xacro to URDF, the tags of this package, third-party MJCF and SDF, one robot mounted on another."""
