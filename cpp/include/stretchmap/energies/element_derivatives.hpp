// Energies of single elements with their derivatives by all corners, for optimizers of a user's
// own.
#pragma once

#include "stretchmap/base/types.hpp"
#include "stretchmap/volume/element_energy.hpp"

namespace stretchmap::energies {

// How many derivatives are computed.
enum Order : int { kValues = 0, kGradients = 1, kHessians = 2 };

// Of k elements with c corners each; unknown 3 a + i is component i of corner a.
struct ElementDerivatives {
  Vec values;      // (k)
  Rows gradients;  // (k, 3 c), no rows below kGradients
  Rows hessians;   // (k, 9 c^2), symmetric, no rows below kHessians
};

// \param image (n, 3).
// \param rest_volumes (k) > 0.
// \return terms 3/2 |f(t)|^2 / |t| of the volumetric stretch energy (5.1) at c = 0.
ElementDerivatives tet_stretch(const PointsRef& image, const TetsRef& tets,
                               const VecRef& rest_volumes, Order order);

// \param image (n, 3).
// \param rest_areas (m) > 0.
// \return terms |g(t)|^2 / |t| of the stretch energy (4.1).
ElementDerivatives face_stretch(const PointsRef& image, const FacesRef& faces,
                                const VecRef& rest_areas, Order order);

// \param image (n, 3).
// \param rest (k, 9) as of volume::rest_matrices.
// \param weights (k) factors of the tets.
// \param w `face` is not used.
// \param projected whether negative eigenvalues of the Hessians by the Jacobians are set to zero.
// \return weight * psi(J) of volume/element_energy.hpp.
// \pre above kValues all energies are finite.
ElementDerivatives tet_distortion(const PointsRef& image, const TetsRef& tets, const RowsRef& rest,
                                  const VecRef& weights, const volume::EnergyWeights& w,
                                  Order order, bool projected);

}  // namespace stretchmap::energies
