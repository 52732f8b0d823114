from __future__ import annotations
import numpy
import numpy.typing
import stretchmap._core.volume
import typing
__all__: list[str] = ['ElementDerivatives', 'face_stretch', 'longest_steps', 'tet_distortion', 'tet_stretch']
class ElementDerivatives:
    @property
    def gradients(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        ...
    @property
    def hessians(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        ...
    @property
    def values(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        ...
def face_stretch(image: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 3]", "flags.c_contiguous"], faces: typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 3]", "flags.c_contiguous"], rest_areas: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"], order: typing.SupportsInt | typing.SupportsIndex) -> ElementDerivatives:
    ...
def longest_steps(tets: typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 4]", "flags.c_contiguous"], image: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 3]", "flags.c_contiguous"], direction: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 3]", "flags.c_contiguous"], limit: typing.SupportsFloat | typing.SupportsIndex) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
    ...
def tet_distortion(image: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 3]", "flags.c_contiguous"], tets: typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 4]", "flags.c_contiguous"], rest: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]", "flags.c_contiguous"], weights: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"], energy: stretchmap._core.volume.EnergyWeights, order: typing.SupportsInt | typing.SupportsIndex, projected: bool) -> ElementDerivatives:
    ...
def tet_stretch(image: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 3]", "flags.c_contiguous"], tets: typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 4]", "flags.c_contiguous"], rest_volumes: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"], order: typing.SupportsInt | typing.SupportsIndex) -> ElementDerivatives:
    ...
