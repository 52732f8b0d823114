// Vector proxies of 1-forms, Hodge star and wedge products on faces: (3.6), (3.7), (3.10).
#pragma once

#include "stretchmap/base/types.hpp"
#include "stretchmap/mesh/surface_topology.hpp"

namespace stretchmap::forms {

// \param form (e) closed.
// \return (m, 3) the tangent vector of each face whose product with an edge is the form on that
// edge,
//         (3.6).
Points form_vectors(const mesh::SurfaceTopology& top, const PointsRef& points, const VecRef& form);

struct HodgeProducts {
  Rows star;   // (k, k) integrals of form_l ^ *form_m: b of (3.10), one column per m
  Rows wedge;  // (k, k) integrals of form_l ^ form_m: c of (3.10), antisymmetric
};

// Both integrals from the vector proxies, face by face.
// \pre faces oriented outward, none without area.
HodgeProducts hodge_products(const mesh::SurfaceTopology& top, const PointsRef& points,
                             const RowsRef& forms);

// \param first,second (e) closed forms.
// \return (m) integral of first ^ second over each face: its signed area in the chart whose
//         coordinates have these differentials.
Vec chart_areas(const mesh::SurfaceTopology& top, const VecRef& first, const VecRef& second);

}  // namespace stretchmap::forms
