// Every defect of a mesh in one pass, whatever is wrong with it. Nothing here throws on a bad mesh
// and nothing assumes that another check has passed.
//
// Elements that repeat a vertex and second copies of an element are reported and then left out of
// all that follows, so that one fault is not reported again as a dozen others.
#pragma once

#include "stretchmap/base/types.hpp"

namespace stretchmap::mesh {

struct SurfaceDiagnosis {
  IndexVec repeated;              // faces that use a vertex twice
  IndexVec duplicates;            // later copies of a face with the same three vertices
  IndexVec degenerate;            // faces without area, see size.hpp
  IndexVec misoriented;           // faces that run against the majority of their patch
  IndexVec conflicts;             // faces where no turning helps: the surface is not orientable
  IndexVec inside_out;            // faces of closed patches that enclose a negative volume
  Edges nonmanifold_edges;        // edges with more than two faces, lower id first
  Edges border_edges;             // edges with one face, lower id first
  IndexVec nonmanifold_vertices;  // vertices with several fans of faces
  IndexVec unreferenced;          // vertices no face uses
  IndexVec component;             // (m) component of each face, -1 where left out
  IndexVec euler;                 // (c) Euler characteristic of each component
  IndexVec genus;                 // (c) genus of each component, -1 unless closed, manifold and
                                  //     orientable
};

struct SolidDiagnosis {
  IndexVec repeated;        // tets that use a vertex twice
  IndexVec duplicates;      // later copies of a tet with the same four vertices
  IndexVec degenerate;      // tets without volume, see size.hpp
  IndexVec misoriented;     // tets that run against their patch, taken with positive total volume
  IndexVec inverted;        // tets oriented like their neighbors and yet negative: folded over
  IndexVec conflicts;       // tets where no turning helps: the solid is not orientable
  Faces nonmanifold_faces;  // faces of more than two tets
  Edges nonmanifold_edges;  // edges with more than two boundary faces
  IndexVec nonmanifold_vertices;  // other vertices whose tets do not surround them as a ball or a
                                  //     half-ball
  IndexVec unreferenced;          // vertices no tet uses
  IndexVec component;             // (k) component of each tet, -1 where left out
  IndexVec euler;                 // (c) Euler characteristic of each component
  Faces boundary_faces;           // (b, 3) faces of one tet, outward, ids of the solid
  IndexVec boundary_component;    // (b)
  IndexVec boundary_genus;        // (bc) genus of each boundary component, -1 as above
};

// \pre indices in range, points finite.
SurfaceDiagnosis diagnose_surface(const PointsRef& points, const FacesRef& faces);
SolidDiagnosis diagnose_solid(const PointsRef& points, const TetsRef& tets, const Poll& poll = {});

}  // namespace stretchmap::mesh
