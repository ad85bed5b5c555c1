"""The literature's laws as files, loaded as any controller of a file is: `--controller FILE.py:NAME`.

Each says its source, what it assumes, what it measures, and how sure its equations are; a test in
tests/benchmark holds it to what it claims.
"""
