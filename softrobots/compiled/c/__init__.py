"""Generated modules as freestanding C99."""
