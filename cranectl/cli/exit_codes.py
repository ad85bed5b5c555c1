"""Exit codes of every command."""

GOOD = 0
LIMIT_EXCEEDED = 1
BAD_INPUT = 2
RUN_STOPPED = 3
UNFORESEEN = 70  # EX_SOFTWARE of sysexits
INTERRUPTED = 130  # 128 + SIGINT, as shells have it

MEANINGS = {
    GOOD: "good: runs ended as expected, limits were kept",
    LIMIT_EXCEEDED: "a limit was exceeded: agreement, a comparison, a bound, a certificate",
    BAD_INPUT: "bad input; the message says what was found, what is allowed, what to do",
    RUN_STOPPED: "a run stopped early, with a slack rope for example; its log is readable",
    UNFORESEEN: "an error that nobody foresaw; --traceback tells where",
    INTERRUPTED: "interrupted: Ctrl-C, a request to terminate, a terminal that is gone",
}
