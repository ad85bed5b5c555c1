"""A session that one watches and steers while it runs: commands, server, recording."""
