"""What every test assumes of the process that it runs in."""

import signal

# Tests send these to themselves and to what they start. A script's background job ignores Ctrl-C, `nohup` the
# hang-up, and who is started by them inherits that.
signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGTERM, signal.SIG_DFL)
if hasattr(signal, "SIGHUP"):
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
