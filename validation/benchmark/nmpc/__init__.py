"""The controller `nmpc` in C, and the program that generates a part of its code."""
