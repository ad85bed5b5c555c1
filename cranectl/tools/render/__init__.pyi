from .draw import draw_runs as draw_runs
from .draw import draw_worst_moment as draw_worst_moment
from .draw import render_settings as render_settings
