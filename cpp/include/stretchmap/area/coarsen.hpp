// A surface with fewer faces over the same chart: vertices are removed one by one, and each is
// remembered as a point of the coarse face it lies in, so a map of the coarse surface is one of the
// fine surface. Maps that need many steps need them on the coarse one alone.
#pragma once

#include "stretchmap/area/chart.hpp"
#include "stretchmap/base/types.hpp"

namespace stretchmap::area {

struct CoarseSurface {
  IndexVec kept;       // (n_c) the vertices that stay, ascending
  SurfaceChart chart;  // of the coarse surface, which numbers them by their place in `kept`
  IndexVec face;       // (n) coarse face each fine vertex lies in
  Points weights;      // (n, 3) its barycentric coordinates there, in the chart
  Edges shift;         // (n, 2) whole turns that bring its turns next to the face's first corner's
};

// Vertices with the smallest stars go first, so the faces become even in space.
// \param points (n, 3), turns (n, 2) without folded faces.
// \param n_faces to stop at; more remain where no vertex can be removed without a fold, a crease
//        that turns back or a needle.
CoarseSurface coarsen(const PointsRef& points, const SurfaceChart& chart, const Points2Ref& turns,
                      Index n_faces);

// Turns of all fine vertices from those of the kept ones, linear on the coarse faces; where this
// folds fine faces that lie across coarse edges, their vertices are drawn to the middle of their
// neighbors.
// \return (n, 2); empty if folds remain.
Points2 prolong(const CoarseSurface& coarse, const SurfaceChart& chart, const Points2Ref& turns);

}  // namespace stretchmap::area
