"""Keep simulated time in step with a clock."""

import time
from collections.abc import Callable

PATIENCE = 0.5  # [s] that a run may fall behind and still catch up


class Pace:
    """Says how long to wait after each block. Waits add up to the simulated time, whatever each one took."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._due = clock()

    def restart(self) -> None:
        """From now on, after a pause."""
        self._due = self._clock()

    def wait(self, seconds: float) -> tuple[float, float]:
        """After a block that should have taken `seconds`: (time to wait, time given up as lost), one is 0."""
        self._due += seconds
        late = self._clock() - self._due
        if late > PATIENCE:
            self.restart()
            return 0.0, late
        return max(-late, 0.0), 0.0
