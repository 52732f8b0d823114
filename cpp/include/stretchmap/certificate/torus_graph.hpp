// A sufficient condition for a polyhedral torus to be embedded: it is a graph over a torus.
//
// Let c(x) be the point of the circle of radius R in the xy-plane nearest to x, and n the outward
// normal of a face. If n . (x - c(x)) > 0 on every face, x -> (u, v) maps each face one to one and
// with positive orientation; if moreover the whole covers the (u, v) torus once, it is one to one,
// and so the polyhedron does not cross itself. On a face n . x is constant and c depends on u
// alone, so the condition is that of a cosine on an interval: it is decided in closed form, with a
// bound on its rounding error.
#pragma once

#include "stretchmap/base/types.hpp"

namespace stretchmap::certificate {

struct TorusGraph {
  IndexVec bad;    // faces where the condition is not proven, ascending
  double winding;  // signed number of times the (u, v) torus is covered, an integer up to rounding;
                   // NaN when `bad` is not empty
};

// faces outward. \pre R > 0.
// strict: faces with a corner a right angle or more from the mean direction of all three are bad,
// too. They are no folds, but maps that avoid them are better where there are few faces.
TorusGraph torus_graph(const PointsRef& points, const FacesRef& faces, double R,
                       bool strict = false);

}  // namespace stretchmap::certificate
