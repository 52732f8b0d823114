// The chart of a genus-one surface: a flat torus of period one in two coordinates, in which areas
// are signed. No mesh is cut: a corner's coordinate is its vertex's plus a whole number of turns.
#pragma once

#include "stretchmap/base/types.hpp"
#include "stretchmap/mesh/surface_topology.hpp"

namespace stretchmap::area {

struct SurfaceChart {
  Index n_vertices = 0;
  Faces faces;    // (m, 3)
  Faces shift_u;  // (m, 3) whole turns of u to be added at each corner, 0 at the first
  Faces shift_v;  // (m, 3) the same for v

  // Corner k of face f, in turns, lifted to the plane so that the three corners fit together.
  Eigen::Vector2d corner(const Points2Ref& turns, Index f, int k) const {
    const Index i = faces(f, k);
    return {turns(i, 0) + shift_u(f, k), turns(i, 1) + shift_v(f, k)};
  }
};

// forms (2, e): integer closed 1-forms of the two coordinates, one number per edge.
// \throws Error "ArrayError" for a wrong shape, "SolverError" for a form that is not closed (ids:
//         faces).
SurfaceChart surface_chart(const mesh::SurfaceTopology& top, const IndexRows& forms);

// (m) signed areas of the faces in the chart; they sum to one for a map of degree one.
Vec turn_areas(const SurfaceChart& chart, const Points2Ref& turns);

// How far along `direction` (n, 2) no face with positive area loses it: `share` of the way to the
// first one, at most `longest`.
double unfolded_step(const SurfaceChart& chart, const Points2Ref& turns,
                     const Points2Ref& direction, double share, double longest);

// The equal-area coordinate of a ring torus, dA = R r du ds: s = v + (r / R) sin v, in radians.
// \pre tube_ratio = r / R in [0, 1).
Vec equal_area_from_angle(const VecRef& v, double tube_ratio);

// Its inverse, Kepler's equation, to rounding; s - v stays within one turn of the argument.
Vec angle_from_equal_area(const VecRef& s, double tube_ratio);

}  // namespace stretchmap::area
