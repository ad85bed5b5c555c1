"""The law `nmpc`: C, and what writes the part of it that is generated."""
