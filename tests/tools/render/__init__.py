"""Draw on one thread: with several, Mesa once drew one moment in two ways."""

import os

os.environ.setdefault("LP_NUM_THREADS", "1")
