"""The six controllers of the thesis and what it calls them; others that cranectl may have are not in it."""

FEEDBACK = {"pole-placement": "pole placement", "lqr": "LQR"}
ROBUSTIFIERS = {"": "feedback alone", "hinf": "S/KS", "loop-shaping": "loop shaping"}
CONTROLLERS = tuple(f"{feedback}+{r}".rstrip("+") for feedback in FEEDBACK for r in ROBUSTIFIERS)


def controller_name(name: str) -> str:
    """A controller as the thesis calls it."""
    feedback, _, robustifier = name.partition("+")
    return FEEDBACK[feedback] + (f" + {ROBUSTIFIERS[robustifier]}" if robustifier else "")
