"""The rig in MuJoCo."""
