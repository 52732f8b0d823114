// The cheap objective by which the poloidal phase and the ratio of the radii are chosen.
#pragma once

#include "stretchmap/area/surface_reference.hpp"
#include "stretchmap/base/types.hpp"

namespace stretchmap::area {

// \param turns (n, 2) u and the equal-area coordinate before the phase is added.
// \param candidates (k, 2) phase in turns and ratio R / r.
// \return (k) for the image on the torus of each candidate the mean of (s1^2 + s2^2 + s1^-2 +
// s2^-2)
//         / 4 over the source's area, s the singular values of a face's map, areas scaled to total
//         one, to about 1e-6; infinite where a face of the image has no area.
Vec phase_energies(const SurfaceReference& reference, const FacesRef& faces,
                   const Points2Ref& turns, const Points2Ref& candidates);

}  // namespace stretchmap::area
