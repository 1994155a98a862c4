"""`python -m softrobots` is the command `softrobots`."""

import sys

from softrobots.cli.main import main

if __name__ == "__main__":
    sys.exit(main())
