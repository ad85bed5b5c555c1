"""Run cases of one scenario, controller and drive on several plants, judge them, and run many at once."""
