#include "stretchmap/forms/cotangent.hpp"

#include <string>
#include <vector>

#include "stretchmap/base/errors.hpp"

namespace stretchmap::forms {

Vec cotangent_weights(const mesh::SurfaceTopology& top, const PointsRef& points) {
  Vec weights = Vec::Zero(top.edges.rows());
  std::vector<Index> at_fault;
  for (Index f = 0; f < top.faces.rows(); ++f) {
    Eigen::Matrix3d x;
    for (int k = 0; k < 3; ++k) x.col(k) = points.row(top.faces(f, k)).transpose();
    const double double_area = (x.col(1) - x.col(0)).cross(x.col(2) - x.col(0)).norm();
    if (!(double_area > 0.0)) {
      at_fault.push_back(f);
      continue;
    }
    for (int k = 0; k < 3; ++k) {
      const int a = (k + 1) % 3, b = (k + 2) % 3;
      const double dot = (x.col(a) - x.col(k)).dot(x.col(b) - x.col(k));
      weights[top.edge[3 * f + a]] += 0.5 * dot / double_area;
    }
  }
  if (!at_fault.empty()) {
    throw Error("DegenerateError",
                std::to_string(at_fault.size()) + " faces have no area; remove or merge them",
                at_fault);
  }
  return weights;
}

SparseMatrix weighted_laplacian(const mesh::SurfaceTopology& top, const VecRef& weights) {
  std::vector<Eigen::Triplet<double, Index>> entries;
  entries.reserve(4 * weights.size());
  for (Index e = 0; e < weights.size(); ++e) {
    const Index i = top.edges(e, 0), j = top.edges(e, 1);
    entries.emplace_back(i, j, -weights[e]);
    entries.emplace_back(j, i, -weights[e]);
    entries.emplace_back(i, i, weights[e]);
    entries.emplace_back(j, j, weights[e]);
  }
  SparseMatrix laplacian(top.n_vertices, top.n_vertices);
  laplacian.setFromTriplets(entries.begin(), entries.end());
  return laplacian;
}

}  // namespace stretchmap::forms
