#include "stretchmap/area/surface_stretch.hpp"

#include "stretchmap/base/parallel.hpp"

namespace stretchmap::area {

namespace {

using Corners = Eigen::Matrix<double, 3, 3>;  // one corner per row

Corners corners_of(const FacesRef& faces, const PointsRef& image, Index f) {
  Corners p;
  for (int k = 0; k < 3; ++k) p.row(k) = image.row(faces(f, k));
  return p;
}

Corners corners_of(const SurfaceChart& chart, const Eigen::Vector2d& periods,
                   const Points2Ref& turns, Index f) {
  Corners p = Corners::Zero();
  for (int k = 0; k < 3; ++k)
    p.row(k).head<2>() = chart.corner(turns, f, k).cwiseProduct(periods).transpose();
  return p;
}

// e_i . e_j / (4 |t|) with e_k the edge opposite to corner k: its rows sum to zero.
Eigen::Matrix3d element(const Corners& p, double area) {
  Corners e;
  for (int k = 0; k < 3; ++k) e.row(k) = p.row((k + 2) % 3) - p.row((k + 1) % 3);
  return e * e.transpose() / (4.0 * area);
}

template <class Of>
SparseMatrix assemble(const SurfacePattern& pattern, const VecRef& areas, const Of& of) {
  Rows elements(areas.size(), 9);
  for_rows(static_cast<Index>(areas.size()), kElementChunk, [&](Index f) {
    Eigen::Map<Eigen::Matrix3d>(elements.row(f).data()) = element(of(f), areas(f));
  });
  SparseMatrix matrix = pattern.matrix();
  pattern.scatter(elements, matrix.valuePtr());
  return matrix;
}

}  // namespace

double surface_stretch_energy(const FacesRef& faces, const VecRef& areas, const PointsRef& image) {
  double energy = 0.0;
  for (Index f = 0; f < areas.size(); ++f) {
    const Corners p = corners_of(faces, image, f);
    const Eigen::Vector3d a = p.row(1) - p.row(0), b = p.row(2) - p.row(0);
    energy += 0.25 * a.cross(b).squaredNorm() / areas(f);
  }
  return energy;
}

SparseMatrix surface_stretch_laplacian(const SurfacePattern& pattern, const FacesRef& faces,
                                       const VecRef& areas, const PointsRef& image) {
  return assemble(pattern, areas, [&](Index f) { return corners_of(faces, image, f); });
}

double chart_stretch_energy(const SurfaceChart& chart, const VecRef& areas,
                            const Eigen::Vector2d& periods, const Points2Ref& turns) {
  const double scale = periods.prod();
  return (scale * turn_areas(chart, turns)).array().square().cwiseQuotient(areas.array()).sum();
}

SparseMatrix chart_stretch_laplacian(const SurfacePattern& pattern, const SurfaceChart& chart,
                                     const VecRef& areas, const Eigen::Vector2d& periods,
                                     const Points2Ref& turns) {
  return assemble(pattern, areas, [&](Index f) { return corners_of(chart, periods, turns, f); });
}

Points2 chart_stretch_product(const SurfaceChart& chart, const VecRef& areas,
                              const Eigen::Vector2d& periods, const Points2Ref& frozen,
                              const Points2Ref& turns) {
  Points2 product = Points2::Zero(chart.n_vertices, 2);
  const Eigen::Vector2d unit(1.0, 1.0);
  for (Index f = 0; f < areas.size(); ++f) {
    const Eigen::Matrix3d weights = element(corners_of(chart, periods, frozen, f), areas(f));
    const Corners values = weights * corners_of(chart, unit, turns, f);
    for (int k = 0; k < 3; ++k) product.row(chart.faces(f, k)) += values.row(k).head<2>();
  }
  return product;
}

}  // namespace stretchmap::area
