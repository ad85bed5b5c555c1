"""Pictures and videos of runs, drawn by MuJoCo's renderer without a screen."""
