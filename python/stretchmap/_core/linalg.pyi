from __future__ import annotations
import numpy
import numpy.typing
import scipy.sparse
import typing
__all__: list[str] = ['SolveReport', 'SpdSolver', 'normal_matrix']
class SolveReport:
    @property
    def converged(self) -> bool:
        ...
    @property
    def iterations(self) -> int:
        ...
    @property
    def negative_curvature(self) -> bool:
        ...
    @property
    def residual(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        ...
class SpdSolver:
    def __init__(self, matrix: scipy.sparse.csr_matrix, backend: str = 'auto') -> None:
        ...
    def refactor(self, values: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"], keep_preconditioner: bool = False) -> None:
        ...
    def solve(self, B: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]", "flags.c_contiguous"], X: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"], tol: typing.SupportsFloat | typing.SupportsIndex = 1e-10, max_iter: typing.SupportsInt | typing.SupportsIndex = 500, must_converge: bool = True) -> tuple[typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"], SolveReport]:
        ...
    @property
    def backend(self) -> str:
        ...
def normal_matrix(A: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]", "flags.c_contiguous"], weights: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
    ...
