"""Read MCAP files, whole, damaged or cut off, as columns of messages; nothing here is about cranes."""
