"""Static equilibria under loads and prescribed displacements: branches with limit points, stability, buckling.

The stiffness in named directions is computed as well. Names are imported at first use, so that model files are read
without the code that finds equilibria.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
