// The chart of a genus-one surface: a flat torus of period one in two coordinates, in which areas
// are signed. No mesh is cut: a corner's coordinate is its vertex's plus a whole number of turns.
#pragma once

#include <vector>

#include "stretchmap/base/types.hpp"
#include "stretchmap/mesh/surface_topology.hpp"

namespace stretchmap::area {

struct SurfaceChart {
  Index n_vertices = 0;
  Faces faces;    // (m, 3)
  Faces shift_u;  // (m, 3) whole turns of u to be added at each corner, 0 at the first
  Faces shift_v;  // (m, 3) the same for v

  // \return corner k of face f in turns, lifted so that the three corners fit together.
  Eigen::Vector2d corner(const Points2Ref& turns, Index f, int k) const {
    const Index i = faces(f, k);
    return {turns(i, 0) + shift_u(f, k), turns(i, 1) + shift_v(f, k)};
  }

  // \return the two edges of face f from its first corner, as columns.
  Eigen::Matrix2d edges(const Points2Ref& turns, Index f) const {
    const Eigen::Vector2d origin = corner(turns, f, 0);
    Eigen::Matrix2d sides;
    sides << corner(turns, f, 1) - origin, corner(turns, f, 2) - origin;
    return sides;
  }
};

// \param forms (2, e) integer closed 1-forms of the two coordinates, one number per edge.
// \throws Error "ArrayError" for a wrong shape, "SolverError" for a form that is not closed (ids:
//         faces).
SurfaceChart surface_chart(const mesh::SurfaceTopology& top, const IndexRows& forms);

// \return (m) signed areas of the faces in the chart; they sum to one for a map of degree one.
Vec turn_areas(const SurfaceChart& chart, const Points2Ref& turns);

// \return the faces without positive area in the chart.
std::vector<Index> folded_faces(const SurfaceChart& chart, const Points2Ref& turns);

// \param direction (n, 2) of the step.
// \return (m) how far each face with positive area keeps it, infinity for others and where always.
Vec unfolded_steps(const SurfaceChart& chart, const Points2Ref& turns, const Points2Ref& direction);

// \param direction (n, 2) of the step.
// \return how far no face with positive area loses it: `share` of the way to the first one, at most
//         `longest`.
double unfolded_step(const SurfaceChart& chart, const Points2Ref& turns,
                     const Points2Ref& direction, double share, double longest);

// The equal-area coordinate of a ring torus, dA = R r du ds: s = v + (r / R) sin v, in radians.
// \pre tube_ratio = r / R in [0, 1).
Vec equal_area_from_angle(const VecRef& v, double tube_ratio);

// \return its inverse, Kepler's equation, to rounding; s - v stays within one turn of the argument.
Vec angle_from_equal_area(const VecRef& s, double tube_ratio);

// The same of one number in [-pi, pi], by Newton's method from a guess.
double equal_area_angle(double s, double tube_ratio, double guess);

}  // namespace stretchmap::area
