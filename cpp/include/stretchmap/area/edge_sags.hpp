// How far the straight edges of a surface's image lie below the torus.
#pragma once

#include "stretchmap/area/chart.hpp"
#include "stretchmap/mesh/surface_topology.hpp"

namespace stretchmap::area {

// \param chart of the same surface.
// \param areas (m) of the faces, up to a factor: as the image is to have them.
// \param angles (n, 2) in radians.
// \param ratio R / r.
// \return (e) how far each edge sags where a face's third corner is, over the height of that one;
//         of its two faces where it is more. At the ends it does not sag: both long edges of a
//         needle can lie deep below the torus and the needle be as thin as it is to be.
Vec edge_sags(const mesh::SurfaceTopology& top, const SurfaceChart& chart, const VecRef& areas,
              const Points2Ref& angles, double ratio);

}  // namespace stretchmap::area
