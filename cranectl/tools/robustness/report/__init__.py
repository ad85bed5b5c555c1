"""The page of a ladder, the figure of a certificate, and their tables."""
