"""The energies maps are made by, for optimizers of your own: values, gradients, Hessians.

Of every element and of the whole mesh, exact, on any number of threads with the same bits. An image
is an array (n, 3), unknown ``3 i + j`` component j of vertex i.
"""

from .distortion import DistortionEnergy
from .energy import ElementDerivatives, Energy
from .line_bound import longest_step
from .stretch import AreaStretch, VolumeStretch

__all__ = [
    "AreaStretch",
    "DistortionEnergy",
    "ElementDerivatives",
    "Energy",
    "VolumeStretch",
    "longest_step",
]
