"""What a certificate finds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.tables import HasSummary, plain_dict, table
from ..errors import CertificationError

MOST_IDS = 1000


__all__ = ["Certificate", "require_certified"]


@dataclass(frozen=True, eq=False)
class Certificate(HasSummary):
    """Outcome of :func:`certify`.

    Attributes
    ----------
    certified : bool
        True when the map is proven to be a bijection.
    reason : str
        What proves it, or the first thing that stands against it.
    checks : dict of str to bool
        Every check made, in order. ``topology``: the source is a coherently oriented manifold with
        connected boundary; ``source_positive``, ``source_embedded``; ``image_positive``: exact
        signs of all tets; ``boundary_graph``: the boundary image is a graph over the torus;
        ``covers_once``; ``boundary_embedded``; ``volume_enclosed``: the tets' volumes add up to the
        volume the boundary image encloses; ``on_torus``: boundary vertices lie on the torus.
        ``boundary_graph`` may fail without harm when ``boundary_embedded`` holds; then
        ``boundary_oriented``, the outward side of every face looking outward, is asked besides.
    quantities : dict of str to float
        Numbers behind the checks: ``winding``, ``image_volume``, ``enclosed_volume``,
        ``torus_distance`` (largest distance of a boundary vertex, relative to r),
        ``smallest_volume`` (of an image tet, relative to the mean).
    ids : dict of str to tuple of int
        Elements at fault, by check: tets for the volumes, boundary faces for the boundary (flat
        list of pairs for crossings), at most 1000 of each; first those of ``reason``.

    Examples
    --------
    >>> import stretchmap as sm
    >>> solid = sm.samples.solid_torus(600)
    >>> found = sm.certify(solid, solid.V)
    >>> found.certified, found.checks["image_positive"], found.ids
    (True, True, {})
    """

    certified: bool
    reason: str
    checks: dict[str, bool]
    quantities: dict[str, float]
    ids: dict[str, tuple[int, ...]]

    def __repr__(self) -> str:
        return f"Certificate({'certified' if self.certified else f'not certified: {self.reason}'})"

    def to_dict(self) -> dict[str, Any]:
        """Everything, JSON-compatible."""
        return plain_dict(self.__dict__)

    def summary(self) -> str:
        """A table of the checks and quantities."""
        rows: dict[str, Any] = {"certified": self.certified, "reason": self.reason}
        return table({**rows, **self.checks, **self.quantities})


class Findings:
    """Checks as they come in; the first failure that counts is the reason."""

    def __init__(self) -> None:
        self.checks: dict[str, bool] = {}
        self.quantities: dict[str, float] = {}
        self.ids: dict[str, tuple[int, ...]] = {}
        self.reason = ""
        self.decisive = ""  # the check the reason is of

    def note(self, name: str, passed: bool, reason: str = "", ids: ArrayLike = ()) -> bool:
        self.checks[name] = bool(passed)
        if not passed:
            self.ids[name] = tuple(np.asarray(ids, int).ravel()[: 2 * MOST_IDS].tolist())
            if reason and not self.reason:
                self.reason, self.decisive = reason, name
        return bool(passed)

    def certificate(self, proof: str) -> Certificate:
        return Certificate(
            certified=not self.reason,
            reason=self.reason or proof,
            checks=self.checks,
            quantities=self.quantities,
            ids={k: self.ids[k] for k in sorted(self.ids, key=lambda k: k != self.decisive)},
        )


def require_certified(certificate: Certificate, what: str, hint: str = "") -> None:
    """Refuse what is not proven to be a bijection, with a hint at what may be the reason.

    Raises
    ------
    CertificationError
        With the reason, and in ``ids`` the elements at fault.
    """
    if not certificate.certified:
        raise CertificationError(
            f"{what} is not certified: {certificate.reason}; {hint and hint + '; '}keep_best=True "
            "returns it all the same",
            next(iter(certificate.ids.values()), ()),
        )
