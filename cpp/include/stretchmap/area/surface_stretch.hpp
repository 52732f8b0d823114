// Stretch energy of a surface map, E_S(g) = 1/2 tr g' L_S(g) g = sum |g(t)|^2 / |t|, and the
// stretch Laplacian (4.2)-(4.3). The cotangent over the stretch factor is e_i . e_j / (4 |t|), e_k
// the image edge opposite to corner k: polynomial in g, so a degenerate image is no trouble.
#pragma once

#include "stretchmap/area/chart.hpp"
#include "stretchmap/area/surface_pattern.hpp"
#include "stretchmap/base/types.hpp"

namespace stretchmap::area {

// \param areas (m) source areas |t| > 0, throughout.
// \return E_S; its gradient is 2 L_S(g) g.
double surface_stretch_energy(const FacesRef& faces, const VecRef& areas, const PointsRef& image);

// \return L_S(g), (n, n), both triangles, positive semi-definite.
SparseMatrix surface_stretch_laplacian(const SurfacePattern& pattern, const FacesRef& faces,
                                       const VecRef& areas, const PointsRef& image);

// The same in the flat torus.
// \param periods what turns are multiplied by.
// \return the sum of squared signed areas over |t|; with areas and periods of total area one it is
//         at least 1, and 1 exactly for an area-preserving map.
double chart_stretch_energy(const SurfaceChart& chart, const VecRef& areas,
                            const Eigen::Vector2d& periods, const Points2Ref& turns);

SparseMatrix chart_stretch_laplacian(const SurfacePattern& pattern, const SurfaceChart& chart,
                                     const VecRef& areas, const Eigen::Vector2d& periods,
                                     const Points2Ref& turns);

// \return (n, 2) product of L_S(frozen) with the multivalued coordinates `turns` (4.5), zero where
//         they are stretched-harmonic. With frozen = turns it is half the gradient of E_S over the
//         periods.
Points2 chart_stretch_product(const SurfaceChart& chart, const VecRef& areas,
                              const Eigen::Vector2d& periods, const Points2Ref& frozen,
                              const Points2Ref& turns);

}  // namespace stretchmap::area
