"""Pictures of runs, studies and scenarios, good enough for a paper; they show what is there.

Loaded when first used: what draws a scenario needs no JAX.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
