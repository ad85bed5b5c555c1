"""Drawn on one thread: with several, Mesa was once seen to draw one moment in two ways."""

import os

os.environ.setdefault("LP_NUM_THREADS", "1")
