"""Controllers from the literature, each in a file of its own; open one by `--controller FILE.py:NAME`.

The docstring of each module gives its equations and these facts:

- Measured: the signals that the controller reads.
- Assumed: the conditions under which its equations hold, and the numbers of the crane that it uses.
- Certain: what is known from the source, and what was derived or chosen here.
- Limits: what it cannot do.

Primes are derivatives with respect to time. A test in tests/benchmark checks each claim.
"""
