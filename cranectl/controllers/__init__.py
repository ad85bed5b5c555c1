"""Control laws and the observer in front of them, compiled."""
