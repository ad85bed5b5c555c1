"""Loaders of controllers from outside the package: Python, C, FMUs, other processes."""
