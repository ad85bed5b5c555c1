"""The robustness certificate: nu-gap to the design model against the coprime margin."""
