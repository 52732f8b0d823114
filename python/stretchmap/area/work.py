"""How much work a map may take: Newton steps on surfaces of various sizes."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from .. import _core
from ..base.budget import Budget, processor_seconds
from ..mesh.surfaces import TriMesh

# In units of what a face adds to a step besides its share of the elimination: so many a face of
# the surface given, and no fewer than those.
_EACH, _LEAST = 1200.0, 5e6
# Where edges may be halved, so many for each second there is, no more than a slow processor gets
# done; and a face for so many, where steps are left for them, or so many in the last rounds, where
# few are added.
_A_SECOND, _A_FACE, _A_LAST_FACE = 4.5e5, 330.0, 130.0
_FLOPS = 2.1e4  # of an elimination, that take as long as one
_TYPICAL = 100.0  # flops over the power 3/2 of the faces, as nested dissection has them
MOST_FACES = 10**6  # of a surface with edges halved
_UNREFINED = 40  # steps where edges can be halved after them
# Steps that others take as long as: one in the flat chart, one without a barrier against faces that
# look inward, halving edges until few sag, and rings made exact.
_CHART, _LOOSE, _FITTING, RINGS = 0.6, 0.9, 3, 8
_ONCE = 0.8  # of what a face adds to a step, where its system is solved more than once
_TOLD = 0.02  # of all the time; steps that took as long tell how long others will take
_KEPT = 0.05  # of it, for the certificate
_OVER = 0.2  # of it, with which too few steps can be afforded


@dataclass
class Work:
    """What is left of it: units, and processor time.

    Where time is enough, units alone count, and are the same each time.

    Attributes
    ----------
    n_faces : int
        Of the surface given.
    left : float
    most : int
        Steps on a surface before edges are halved where they end short.
    clock : Budget
    reserved : float
        Share of all that is left for what follows should this lead nowhere.
    """

    n_faces: int
    left: float
    most: int
    clock: Budget = field(default_factory=lambda: Budget(math.inf))
    reserved: float = 0.0
    _flops: float = _TYPICAL  # of the surfaces seen last
    _begun: float | None = None
    _newton: _core.area.SurfaceNewton | None = None  # whose steps have begun
    _solved: int = 0  # by it before
    _units: float = 0.0  # of which is known how long they took
    _seconds: float = 0.0

    def __post_init__(self) -> None:
        self._whole = self.left

    @classmethod
    def of(cls, surface: TriMesh, clock: Budget, *, refine: bool) -> Work:
        """All of it; of finite time where edges may be halved."""
        units = _A_SECOND * clock.seconds if refine else _EACH * surface.n_faces
        work = cls(surface.n_faces, max(units, _LEAST), _UNREFINED, clock)
        if not refine:
            work.most = work.steps()
        return work

    def begin(self, newton: _core.area.SurfaceNewton, n_faces: int) -> None:
        """Steps, of which the next `spend` tells how many they were.

        Where it is solved more than once in a step, that counts. What its elimination takes, which
        separators tell, holds for finer surfaces, too.
        """
        self._begun, self._newton, self._solved = processor_seconds(), newton, newton.solves
        self._flops = newton.flops() / n_faces**1.5

    def spend(self, steps: int, n_faces: int | None = None, each: float = 1.0) -> None:
        """Newton steps on a surface of so many faces, each of which takes as long as so many."""
        n_faces = n_faces or self.n_faces
        cost = self._cost(n_faces)
        units = each * steps * cost
        if self._newton is not None:
            units += max(self._newton.solves - self._solved - steps, 0) * (cost - _ONCE * n_faces)
            self._newton = None
        self.left -= units
        if self._begun is not None:
            self._units += units
            self._seconds += processor_seconds() - self._begun
            self._begun = None

    def spend_in_chart(self, steps: int) -> None:
        """Newton steps in the flat chart."""
        self.spend(steps, each=_CHART)

    def spend_on_approach(self, steps: int, n_faces: int) -> None:
        """Newton steps on a surface of so many faces, whichever way these look."""
        self.spend(steps, n_faces, _LOOSE)

    def spend_on_fitting(self, n_faces: int) -> None:
        """Edges halved until none sags too much, which has led to so many faces."""
        self.spend(_FITTING, n_faces)

    def spend_on_rings(self, n_faces: int) -> None:
        """The projection of the rings of a surface of so many faces."""
        self.spend(RINGS, n_faces)

    def steps(self, n_faces: int | None = None, *, least: int = 0, most: float = math.inf) -> int:
        """Newton steps that can be afforded on a surface of so many faces.

        At least so many, if there is time for them, and at most so many.
        """
        cost = self._cost(n_faces or self.n_faces)
        left = self.left - self.reserved * self._whole
        units = min(max(left, least * cost), most * cost)
        return max(int(min(units, self._in_time()) / cost + 1e-9), 0)

    def most_faces(self, steps: int, *, last: bool = False) -> int:
        """Those of the largest surface on which so many steps, one at least, can be afforded.

        No more than there may be, which are more in the last rounds.
        """
        few, many = 0, 1
        while self.steps(many) >= steps:
            few, many = many, 2 * many
        while many - few > 1:
            middle = (few + many) // 2
            few, many = (middle, many) if self.steps(middle) >= steps else (few, middle)
        return min(few, int(self._whole / (_A_LAST_FACE if last else _A_FACE)), MOST_FACES)

    def late(self) -> bool:
        """Whether what time is left is reserved, or for the certificate."""
        return self.clock.left < (_KEPT + self.reserved) * self.clock.seconds

    def out_of_time(self) -> bool:
        """Whether it is time that has run out, and not units."""
        return self.clock.left < _OVER * self.clock.seconds and self._in_time() < self.left

    def _cost(self, n_faces: int) -> float:
        """Of a step."""
        return n_faces * (1.0 + self._flops * math.sqrt(n_faces) / _FLOPS)

    def _in_time(self) -> float:
        """Units there is time for, at the rate of the steps so far."""
        if self._seconds < _TOLD * self.clock.seconds or self._units == 0.0:
            return math.inf
        left = max(self.clock.left - (_KEPT + self.reserved) * self.clock.seconds, 0.0)
        return left * self._units / self._seconds
