"""Populations: solids brought into correspondence, their mean, modes, and statistics of fields."""

from ..deformation.similarity import Similarity
from .correspondence import Correspondence, correspond
from .executors import Dask, Processes, Serial
from .fields import FieldStatistics, carry_field, field_statistics
from .measures import ModelMeasures, measure_model
from .procrustes import Procrustes, generalized_procrustes
from .result import Population
from .run import fit
from .shape_model import ShapeModel, shape_model

__all__ = [
    "Correspondence",
    "Dask",
    "FieldStatistics",
    "ModelMeasures",
    "Population",
    "Processes",
    "Procrustes",
    "Serial",
    "ShapeModel",
    "Similarity",
    "carry_field",
    "correspond",
    "field_statistics",
    "fit",
    "generalized_procrustes",
    "measure_model",
    "shape_model",
]
