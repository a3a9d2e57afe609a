"""Static equilibria under loads and travel: their branches past limit points, stability, buckling, stiffness.

Names are imported when they are first used: model files are read without what finds equilibria.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
