// The chart of a surface whose edges are halved.
#pragma once

#include "stretchmap/area/chart.hpp"
#include "stretchmap/mesh/halved_faces.hpp"

namespace stretchmap::area {

struct HalvedChart {
  Points2 angles;  // (n', 2) in radians; the first n are those given
  Faces shift_u;   // (m', 3) whole turns of u to be added at each corner
  Faces shift_v;   // (m', 3) the same for v
};

// Midpoints lie halfway in the chart, too, where no face turns over then.
// \param angles (n, 2) in radians.
// \throws Error "ArrayError" for a chart of another surface.
HalvedChart halved_chart(const SurfaceChart& chart, const Points2Ref& angles,
                         const mesh::HalvedFaces& halved);

// \param shift_u, shift_v (m, 3) whole turns to be added at the corners.
// \return (2, e) the 1-forms whose sums along the edges of the faces are their differences.
// \throws Error "ArrayError" for another number of faces.
IndexRows chart_forms(const mesh::SurfaceTopology& top, const FacesRef& shift_u,
                      const FacesRef& shift_v);

}  // namespace stretchmap::area
