"""MCAP files as columns of messages: whole, damaged or cut off. Knows no crane."""
