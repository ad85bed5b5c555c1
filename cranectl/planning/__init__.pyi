from .limits import AXES as AXES
from .limits import Limits as Limits
from .limits import limits_of as limits_of
from .motions import add_claims as add_claims
from .motions import load_scenario as load_scenario
from .motions import plan_motions as plan_motions
from .review import ACTIVE_SHARE as ACTIVE_SHARE
from .review import Review as Review
