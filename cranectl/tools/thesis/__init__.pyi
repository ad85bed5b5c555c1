from .command import run_thesis as run_thesis
from .page import ChapterFigures as ChapterFigures
from .page import printed_tables as printed_tables
from .page import thesis_page as thesis_page
from .reproduction import reproduce as reproduce
from .reproduction import total_simulated_seconds as total_simulated_seconds
