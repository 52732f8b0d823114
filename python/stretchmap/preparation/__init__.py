"""From a raw surface or a voxel mask to a solid that can be mapped."""

from .handles import HandleCut
from .pipeline import prepare
from .report import Preparation, Step

__all__ = ["HandleCut", "Preparation", "Step", "prepare"]
