"""Open controllers from outside the package, and load those in Python files and C libraries."""
