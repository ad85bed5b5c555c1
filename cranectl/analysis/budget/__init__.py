"""The error budget: what each fidelity level will cost, predicted before it is run, with a bound."""
