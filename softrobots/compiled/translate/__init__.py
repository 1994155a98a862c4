"""Translation of generated modules from the kernel language, a subset of Python, to freestanding C99 and to JavaScript."""
