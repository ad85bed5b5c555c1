"""Write, read and describe logs: one MCAP file for a run, or for the runs of several plants."""
