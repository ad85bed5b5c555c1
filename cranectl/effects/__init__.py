"""What separates a rig from its model: one module per effect, each on or off by itself."""
