"""Laws of the literature in validation/benchmark: each has what it claims."""
