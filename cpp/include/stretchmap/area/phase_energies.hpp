// The cheap objective by which the poloidal phase and the ratio of the radii are chosen.
#pragma once

#include "stretchmap/area/surface_quality.hpp"
#include "stretchmap/base/types.hpp"

namespace stretchmap::area {

// \param turns (n, 2) u and the equal-area coordinate before the phase is added.
// \param candidates (k, 2) phase in turns and ratio R / r.
// \return (k) SurfaceQuality::energy of the image on the torus of each candidate, to about 1e-6;
//         infinite where a face of the image has no area.
Vec phase_energies(const SurfaceReference& reference, const FacesRef& faces,
                   const Points2Ref& turns, const Points2Ref& candidates);

}  // namespace stretchmap::area
