"""Load controllers from outside the package: Python files, C libraries, FMUs and other processes."""
