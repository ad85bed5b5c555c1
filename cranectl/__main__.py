"""`python -m cranectl`."""

import sys

from cranectl.cli.main import main

sys.exit(main())
