"""Our rigid equations: the crane as a Lagrange system, and its flatness."""
