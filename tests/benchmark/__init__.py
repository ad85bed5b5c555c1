"""Controllers of the literature in validation/benchmark have the properties that they claim."""
