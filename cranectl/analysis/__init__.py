"""What sets a rig apart from its design model: measured, predicted, certified."""
