"""Simulations one can step, sampled controllers, and laws for them.

Names are imported when they are first used: model files with controllers are read without what runs them.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
