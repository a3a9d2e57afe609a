"""Time integration: methods as objects, own schemes by tableaux and coefficients, adapters to SciPy and SUNDIALS.

Names are imported at first use, so that methods are listed and checked without the code that integrates.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
