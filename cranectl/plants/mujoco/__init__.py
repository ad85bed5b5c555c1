"""The rig in MuJoCo, and its effects, a file each."""
