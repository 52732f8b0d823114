from __future__ import annotations
import numpy
import numpy.typing
import stretchmap._core.volume
import typing
__all__: list[str] = ['BoundaryFit', 'FitSamples', 'HexNewton', 'HexNewtonReport', 'HexReport', 'hex_volumes', 'jacobian_coefficients', 'scaled_jacobians', 'valid_hexes']
class FitSamples:
    @property
    def distance(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        ...
    @property
    def first_of_surface(self) -> int:
        ...
    @property
    def share(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        ...
class BoundaryFit:
    def __init__(self, points: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 3]", "flags.c_contiguous"], faces: typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 3]", "flags.c_contiguous"], normals: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 3]", "flags.c_contiguous"], sample_faces: typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 1]"], sample_weights: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 3]", "flags.c_contiguous"], quads: typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 4]", "flags.c_contiguous"], per_side: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def match(self, x: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 3]", "flags.c_contiguous"]) -> FitSamples:
        ...
class HexReport:
    @property
    def energy(self) -> float:
        ...
    @property
    def fit(self) -> float:
        ...
    @property
    def flips(self) -> int:
        ...
    @property
    def min_det(self) -> float:
        ...
class HexNewtonReport:
    @property
    def after(self) -> HexReport:
        ...
    @property
    def before(self) -> HexReport:
        ...
    @property
    def cg_iterations(self) -> int:
        ...
    @property
    def steps(self) -> int:
        ...
class HexNewton:
    def __init__(self, hexes: typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 8]", "flags.c_contiguous"], n: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def model(self, x: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 3]", "flags.c_contiguous"], corner: stretchmap._core.volume.EnergyWeights, power: typing.SupportsFloat | typing.SupportsIndex = 1.0) -> tuple[typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 3]"], typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 1]"], typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 1]"], typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]]:
        """
        Gradient and Hessian in blocks of 3x3, for checks.
        """
    def run(self, x: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"], corner: stretchmap._core.volume.EnergyWeights, power: typing.SupportsFloat | typing.SupportsIndex, max_steps: typing.SupportsInt | typing.SupportsIndex, least_gain: typing.SupportsFloat | typing.SupportsIndex = 0.001) -> tuple[typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 3]"], HexNewtonReport]:
        ...
    def set_fit(self, samples: FitSamples, factor: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]) -> None:
        ...
    def set_rest(self, sides: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]", "flags.c_contiguous"], weights: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]) -> None:
        ...
    def value(self, x: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 3]", "flags.c_contiguous"], corner: stretchmap._core.volume.EnergyWeights, power: typing.SupportsFloat | typing.SupportsIndex = 1.0) -> HexReport:
        ...
def hex_volumes(points: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 3]", "flags.c_contiguous"], hexes: typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 8]", "flags.c_contiguous"]) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
    ...
def jacobian_coefficients(corners: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[8, 3]"]) -> typing.Annotated[list[float], "FixedSize(27)"]:
    """
    Of one hexahedron, for checks.
    """
def scaled_jacobians(points: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 3]", "flags.c_contiguous"], hexes: typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 8]", "flags.c_contiguous"]) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 8]"]:
    ...
def valid_hexes(points: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 3]", "flags.c_contiguous"], hexes: typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 8]", "flags.c_contiguous"]) -> typing.Annotated[numpy.typing.NDArray[numpy.uint8], "[m, 1]"]:
    ...
