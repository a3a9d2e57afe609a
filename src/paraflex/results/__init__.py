"""Results: one labelled dataset per study, saved as netCDF with provenance; metrics.

Names are imported at their first use, so that files can be read without importing the code that computes them.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
