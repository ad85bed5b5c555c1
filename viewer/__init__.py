"""Tests that open logs in a viewer; see README.md."""
