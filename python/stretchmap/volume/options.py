"""Knobs of the flip-free optimisation."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["FlipFreeOptions"]


@dataclass(frozen=True)
class FlipFreeOptions:
    """Knobs of the flip-free minimisation; the defaults are meant for every mesh.

    Attributes
    ----------
    volume_weight : float
        Largest lambda.
    growth : float
        Factor by which lambda grows.
    frozen_weight : float
        Lambda at which the boundary starts to glide, if it does.
    face_weight : float
        Weight of the boundary triangles' barrier while the boundary glides.
    max_aspect : float
        Source tets with a larger ratio of extreme singular values (relative to a regular tet) are
        slivers: their shape is not asked to be kept.
    untangle_iter, frozen_iter, glide_iter : int
        Most steps of each stage.
    target_iter, shift_iter : int
        Most steps of each kind that equalise the volumes along u, v and s.
    marginal_tol : float
        No more of the first kind when no level is off by more than this share of the volume.
    floor : float
        Least determinant untangling aims for: a start closer to folding than that makes the barrier
        too steep for rounded arithmetic.
    glide_tol, frozen_tol : float
        At the largest lambda: stop when a step lowers the energy by no more than this share. With
        the boundary held the decrease is slower from the beginning.
    exact_std_factor : float
        `FlipFreeSolver.make_rings_exact` may raise the SD of the tet ratios by this factor.
    shared : int
        Most steps in a row that share one Hessian; 1 renews it at every step.
    cg_tol, max_cg
        Relative residual and most iterations of the linear solves.

    Examples
    --------
    >>> import stretchmap as sm
    >>> options = sm.FlipFreeOptions(glide_iter=5)
    >>> sm.volume_map(sm.samples.solid_torus(600), options=options).distortion.flips
    0
    """

    volume_weight: float = 1e4
    growth: float = 2.0
    frozen_weight: float = 10.0
    face_weight: float = 1.0
    max_aspect: float = 6.0
    untangle_iter: int = 200
    frozen_iter: int = 150
    glide_iter: int = 60
    target_iter: int = 8
    shift_iter: int = 4
    marginal_tol: float = 1e-4
    floor: float = 1e-3
    glide_tol: float = 2e-3
    frozen_tol: float = 5e-4
    exact_std_factor: float = 1.25
    shared: int = 5
    cg_tol: float = 0.1
    max_cg: int = 200
