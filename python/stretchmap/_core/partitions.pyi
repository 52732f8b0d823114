from __future__ import annotations
import numpy
import numpy.typing
import typing
__all__: list[str] = ['TetSplit', 'split_tets', 'volume_below']
class TetSplit:
    @property
    def cut_edges(self) -> typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 2]"]:
        ...
    @property
    def cut_weight(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        ...
    @property
    def parent(self) -> typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 1]"]:
        ...
    @property
    def side(self) -> typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 1]"]:
        ...
    @property
    def tets(self) -> typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 4]"]:
        ...
def split_tets(tets: typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 4]", "flags.c_contiguous"], values: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"], gate: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]) -> TetSplit:
    ...
def volume_below(tets: typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 4]", "flags.c_contiguous"], volumes: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"], values: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]) -> float:
    ...
