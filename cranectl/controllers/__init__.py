"""Control controllers and the observer in front of them, compiled."""
