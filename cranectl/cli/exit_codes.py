"""Exit codes of every command."""

GOOD = 0
LIMIT_EXCEEDED = 1
BAD_INPUT = 2
RUN_STOPPED = 3
INTERRUPTED = 130  # 128 + SIGINT, as shells have it
