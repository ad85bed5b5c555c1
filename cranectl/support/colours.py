"""The colours of figures, reports and pictures."""

# Role: (light, dark). Series are told apart by people with colour-vision deficiencies, and by lightness.
COLOURS = {
    "ink": ("#1b1f24", "#e8ebee"),
    "muted": ("#5b6470", "#a3adb8"),
    "grid": ("#dde1e6", "#363d47"),
    "reference": ("#7b838d", "#98a2ae"),
    "limit": ("#c02a2a", "#ff7d7d"),
    "series-1": ("#1d63ad", "#6fb2f7"),
    "series-2": ("#cf5d06", "#ffa15a"),
    "series-3": ("#0c7d59", "#48d3a3"),
    "series-4": ("#9b3586", "#e892d5"),
}
LIGHT = {role: pair[0] for role, pair in COLOURS.items()}  # on a light page, by role
SLACK_ROPE = "#ff400d"  # of a rope without tension

# In viewers, whose ground is light or dark: these are seen on both.
VIEWER_SERIES = (
    "#4e98e2", "#f5774d", "#5cd6a9", "#f7df71", "#c792ea", "#ff7d7d",
    "#4ed8da", "#b5bd68", "#e88fbf", "#9a8bff", "#c9a27e", "#a6e22e", "#d33682",
)  # fmt: skip
VIEWER = {  # in a viewer, by role
    **{f"series-{k}": colour for k, colour in enumerate(VIEWER_SERIES, 1)},
    "reference": "#9aa3ad",
    "rope": "#8c9eb3",
    "disturbance": "#f2a60d",
}


def rgb(colour: str) -> tuple[float, float, float]:
    """Return `#rrggbb` as three numbers from 0 to 1."""
    red, green, blue = (int(colour[k : k + 2], 16) / 255.0 for k in (1, 3, 5))
    return red, green, blue
