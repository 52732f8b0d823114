// How far a flat face looks outward, as a function of its six angles.
//
// With A the area vector of the face and c(x) the point of the torus' center circle nearest to x,
// A . (x - c(x)) > 0 on the whole face is what makes the polyhedron a graph over the torus (see
// certificate/torus_graph.hpp). A . x is constant on the face, so it is the least of a cosine on
// the face's interval of u: taken at a corner, or where u has the direction of A.
#pragma once

#include "area/face_jet.hpp"

namespace stretchmap::area {

// Over the tube's radius, at corner k: the component of A along the torus' normal there.
Jet corner_facing(const TorusPoint (&p)[3], int k, bool second);

struct Facing {
  Jet corner[3];
  Jet least;  // over the whole face
};

// Its `least` alone, without derivatives.
double least_facing(const TorusPoint (&p)[3], const Torus& torus);

Facing facing(const TorusPoint (&p)[3], const Torus& torus, bool second);

}  // namespace stretchmap::area
