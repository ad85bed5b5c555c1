"""The error budget: what each rung of the ladder will cost, said before it is run, with a bound."""
