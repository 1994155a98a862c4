"""A robot that follows commands from keys, a pipe or a watched file, in a viewer: `softrobots view --live`."""
