"""``python -m stretchmap.cli``."""

import sys

from . import main

sys.exit(main())
