"""The literature's laws as files, which enter by the doors that any law does: `--controller FILE.py:NAME`.

Each says its source, what it assumes, what it measures, and how sure its equations are; a test in
tests/benchmark holds it to what it claims.
"""
