#include "stretchmap/mesh/rounded_triangle.hpp"

#include <cmath>

namespace stretchmap::mesh {

// A map of the plane is the sum of a similarity S and a mirrored one M; its singular values are
// |S| + |M| and |S| - |M|. To scale S and M keeps the singular vectors.
Eigen::Matrix2d rounded_triangle(const Eigen::Matrix2d& edges, double max_aspect) {
  Eigen::Matrix2d regular;
  regular << 1.0, 0.5, 0.0, 0.8660254037844386;
  const Eigen::Matrix2d map = edges * regular.inverse();
  // |map|^2 / (2 det) = (a + 1/a) / 2 for the ratio a of the singular values.
  if (map.squaredNorm() <= map.determinant() * (max_aspect + 1.0 / max_aspect)) return edges;
  Eigen::Matrix2d cofactor;
  cofactor << map(1, 1), -map(1, 0), -map(0, 1), map(0, 0);
  const Eigen::Matrix2d similar = 0.5 * (map + cofactor), mirrored = 0.5 * (map - cofactor);
  const double longer = std::sqrt(map.determinant() * max_aspect), shorter = longer / max_aspect;
  const double root2 = std::sqrt(2.0);  // the norm of a similarity is this times its factor
  return ((longer + shorter) / root2 / similar.norm() * similar +
          (longer - shorter) / root2 / mirrored.norm() * mirrored) *
         regular;
}

}  // namespace stretchmap::mesh
