"""
C++ core of stretchmap; private, its arguments are validated by the Python layer.
"""
from __future__ import annotations
from . import base
from . import mesh
from . import forms
from . import homology
from . import linalg
from . import measures
from . import maps
from . import certificate
from . import partitions
from . import area
from . import volume
from . import energies
from . import registration
from . import resample
from . import testing
__all__: list[str] = ['area', 'base', 'certificate', 'energies', 'forms', 'homology', 'linalg', 'maps', 'measures', 'mesh', 'partitions', 'registration', 'resample', 'testing', 'volume']
