from .conditions import StaticsDefaults as StaticsDefaults
from .result import Statics as Statics
from .steps import statics as statics
