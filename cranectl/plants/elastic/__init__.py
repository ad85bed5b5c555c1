"""The crane as it is built, by Kane's method: servos that feel the load, rope, body, frame, air, friction."""
