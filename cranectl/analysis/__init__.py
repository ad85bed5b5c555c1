"""What sets a rig apart from its design model: measured, predicted, and whether the controller survives it."""
