"""Simulation in steps, sampled controllers, and control laws.

Names are imported on first use, so that model files with controllers are read without the modules that run them.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
