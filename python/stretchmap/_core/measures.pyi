from __future__ import annotations
import numpy
import numpy.typing
import typing
__all__: list[str] = ['ElementMeasures', 'face_measures', 'ring_sums', 'tet_measures']
class ElementMeasures:
    @property
    def angle(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        ...
    @property
    def conformal(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        ...
    @property
    def image(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        ...
    @property
    def source(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        ...
def face_measures(points: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 3]", "flags.c_contiguous"], faces: typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 3]", "flags.c_contiguous"], image: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 3]", "flags.c_contiguous"], sign: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]) -> ElementMeasures:
    ...
def ring_sums(elements: typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, n]", "flags.c_contiguous"], values: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"], n_vertices: typing.SupportsInt | typing.SupportsIndex) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
    ...
def tet_measures(points: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 3]", "flags.c_contiguous"], tets: typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 4]", "flags.c_contiguous"], image: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 3]", "flags.c_contiguous"]) -> ElementMeasures:
    ...
