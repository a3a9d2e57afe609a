"""Results: one labelled dataset per study, saved as netCDF with provenance; metrics.

Names are imported when they are first used: files are read without what computes them.
"""

import lazy_loader

# A module called like what it holds: imported later it would stand in for that.
from paraflex.results.summary import summary as summary

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
