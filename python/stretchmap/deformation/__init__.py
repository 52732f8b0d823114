"""Smooth deformations in space: poses, thin-plate splines, and surfaces laid on others by them."""

from .fitting import Anchors, Template

__all__ = ["Anchors", "Template"]
