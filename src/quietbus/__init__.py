"""quietbus: vibration isolation platforms for control moment gyroscopes on satellites.

Names are loaded when first used, so that ``import quietbus`` is quick.
"""

import importlib.metadata

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
__version__ = importlib.metadata.version("quietbus")
