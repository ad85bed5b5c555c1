"""The command line: the only place that knows files named by users, terminals and exit codes."""
