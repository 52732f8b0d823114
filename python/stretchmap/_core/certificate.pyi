from __future__ import annotations
import numpy
import numpy.typing
import typing
__all__: list[str] = ['TorusGraph', 'crossing_faces', 'not_positive_tets', 'torus_graph']
class TorusGraph:
    @property
    def bad(self) -> typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 1]"]:
        ...
    @property
    def winding(self) -> float:
        ...
def crossing_faces(points: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 3]", "flags.c_contiguous"], faces: typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 3]", "flags.c_contiguous"], limit: typing.SupportsInt | typing.SupportsIndex) -> typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 2]"]:
    ...
def not_positive_tets(points: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 3]", "flags.c_contiguous"], tets: typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 4]", "flags.c_contiguous"]) -> typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 1]"]:
    ...
def torus_graph(points: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 3]", "flags.c_contiguous"], faces: typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 3]", "flags.c_contiguous"], R: typing.SupportsFloat | typing.SupportsIndex, strict: bool = False) -> TorusGraph:
    ...
