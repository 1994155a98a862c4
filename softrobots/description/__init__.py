"""Robot descriptions: xacro to URDF, our tags, trees of links, foreign MJCF and SDF, one robot mounted on another."""
