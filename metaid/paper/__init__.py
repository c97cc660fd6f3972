"""What is the paper's own: its search, its whole counts matched (`counting/`), its tables, figure and sweep, run again
beside what it printed. All but the search loads numba, once it runs.
"""

from metaid.paper.dinoip import MOST_STEPS_UP, Dinoip, DinoipOptions
from metaid.paper.tables import LIKE, PURE, paper_table, run_fig4, run_sweep, run_table, show_fig4
