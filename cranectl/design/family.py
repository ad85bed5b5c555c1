"""The controllers of the flat family, named FEEDBACK or FEEDBACK+ROBUSTIFIER.

This file imports nothing, so that commands can list these controllers at once.
"""

FEEDBACKS = {
    "pole-placement": "flatness-based tracker, poles placed",
    "lqr": "flatness-based tracker, linear-quadratic regulator",
}
ROBUSTIFIERS = {
    "": "",
    "hinf": ", robustified by mixed sensitivity",
    "loop-shaping": ", robustified by loop shaping",
}
TITLES = {  # what each controller of the flat family is, in words, by its name
    f"{feedback}+{robustifier}".rstrip("+"): title + by
    for feedback, title in FEEDBACKS.items()
    for robustifier, by in ROBUSTIFIERS.items()
}
CONTROLLERS = tuple(TITLES)  # names of the flat family
