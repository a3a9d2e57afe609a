"""Static equilibria under loads and travel: their branches past limit points, stability, buckling, stiffness."""

from paraflex.equilibria.defaults import StaticsDefaults as StaticsDefaults
from paraflex.equilibria.result import Statics as Statics
from paraflex.equilibria.statics import statics as statics
