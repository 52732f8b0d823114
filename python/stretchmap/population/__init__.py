"""Populations: solids brought into correspondence, their mean, modes, and statistics of fields."""

from .correspondence import Correspondence, correspond
from .measures import ModelMeasures, measure_model
from .procrustes import Procrustes, Similarity, generalized_procrustes
from .shape_model import ShapeModel, shape_model

__all__ = [
    "Correspondence",
    "ModelMeasures",
    "Procrustes",
    "ShapeModel",
    "Similarity",
    "correspond",
    "generalized_procrustes",
    "measure_model",
    "shape_model",
]
