"""``python -m markerless_tracker VERB``."""

import sys

from markerless_tracker.cli.main import main

if __name__ == "__main__":
    sys.exit(main())
