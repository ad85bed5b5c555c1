"""The page of a rig: advice, certificate, budget, ladder."""
