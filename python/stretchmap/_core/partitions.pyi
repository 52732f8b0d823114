from __future__ import annotations
import numpy
import numpy.typing
import typing
__all__: list[str] = ['EVERYWHERE', 'TetSplit', 'shares_below', 'split_tets', 'volume_below']
class TetSplit:
    @property
    def cut_edges(self) -> typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 2]"]:
        ...
    @property
    def cut_level(self) -> typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 1]"]:
        ...
    @property
    def parent(self) -> typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 1]"]:
        ...
    @property
    def slab(self) -> typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 1]"]:
        ...
    @property
    def tets(self) -> typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 4]"]:
        ...
def shares_below(values: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 4]", "flags.c_contiguous"]) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
    ...
def split_tets(tets: typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 4]", "flags.c_contiguous"], n_vertices: typing.SupportsInt | typing.SupportsIndex, places: typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 4]", "flags.c_contiguous"], period: typing.SupportsInt | typing.SupportsIndex) -> TetSplit:
    ...
def volume_below(tets: typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 4]", "flags.c_contiguous"], volumes: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"], values: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]) -> float:
    ...
EVERYWHERE: int = -2147483648
