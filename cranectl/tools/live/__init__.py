"""Run a session that a user watches and steers live: commands, server and recording."""
