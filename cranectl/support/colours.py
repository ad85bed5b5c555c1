"""The colours of figures, reports and pictures."""

from typing import ClassVar

# By role: light, dark. Series are told apart by people with colour-vision deficiencies, and by lightness.
_COLOURS = {
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
# In viewers, whose ground is light or dark: these are seen on both.
_VIEWER_SERIES = (
    "#4e98e2", "#f5774d", "#5cd6a9", "#f7df71", "#c792ea", "#ff7d7d",
    "#4ed8da", "#b5bd68", "#e88fbf", "#9a8bff", "#c9a27e", "#a6e22e", "#d33682",
)  # fmt: skip


class Palette(dict[str, str]):
    """Colours `#rrggbb` by their role."""

    LIGHT: ClassVar["Palette"]  # on a light ground, as pictures have
    DARK: ClassVar["Palette"]  # on a dark ground
    VIEWER: ClassVar["Palette"]  # seen on both

    @property
    def series_roles(self) -> tuple[str, ...]:
        """The roles of series, in their order."""
        return tuple(role for role in self if role.startswith("series-"))

    @property
    def series(self) -> tuple[str, ...]:
        """The colours of series, in their order."""
        return tuple(self[role] for role in self.series_roles)

    def rgb(self, colour: str) -> tuple[float, float, float]:
        """Return the colour of a role, or `#rrggbb`, as three numbers from 0 to 1."""
        colour = self.get(colour, colour)
        red, green, blue = (int(colour[k : k + 2], 16) / 255.0 for k in (1, 3, 5))
        return red, green, blue


Palette.LIGHT = Palette({role: light for role, (light, _) in _COLOURS.items()})
Palette.DARK = Palette({role: dark for role, (_, dark) in _COLOURS.items()})
Palette.VIEWER = Palette({f"series-{k}": colour for k, colour in enumerate(_VIEWER_SERIES, 1)})
Palette.VIEWER |= {"reference": "#9aa3ad", "rope": "#8c9eb3", "disturbance": "#f2a60d"}
Palette.VIEWER["slack-rope"] = "#ff400d"
