"""One scenario, controller and drive on the plants, judged; many at once."""
