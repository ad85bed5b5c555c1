"""Drawn on one thread: with several, Mesa's software renderer was once seen to give one picture in two ways."""

import os

os.environ.setdefault("LP_NUM_THREADS", "1")
