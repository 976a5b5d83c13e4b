"""``python -m unsmear``."""

import sys

from unsmear.cli import main

sys.exit(main())
