"""Studies: sets of runs evaluated together and returned as one result.

Names are imported at their first use, so that one kind of study is run without importing the others.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
