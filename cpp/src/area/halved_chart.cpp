#include "stretchmap/area/halved_chart.hpp"

#include <cmath>
#include <utility>

#include "stretchmap/base/errors.hpp"
#include "stretchmap/base/torus.hpp"

namespace stretchmap::area {

HalvedChart halved_chart(const SurfaceChart& chart, const Points2Ref& angles,
                         const mesh::HalvedFaces& halved) {
  const Index n = chart.n_vertices, m = static_cast<Index>(halved.faces.rows());
  const bool same_faces = m > 0 && halved.parent(m - 1) + 1 == chart.faces.rows();
  if (angles.rows() != n || !same_faces || halved.faces.maxCoeff() + 1 != n + halved.ends.rows())
    throw Error("ArrayError", "the chart is of another surface than the edges halved");
  Points2 corners(3 * m, 2);
  Points2 found(n + halved.ends.rows(), 2);
  for (Index f = 0; f < m; ++f) {
    const Index parent = halved.parent(f);
    Eigen::Vector2d corner[6];  // in the order of slots
    for (int k = 0; k < 3; ++k) {
      const Index i = chart.faces(parent, k);
      corner[k] << angles(i, 0) + kTwoPi * chart.shift_u(parent, k),
          angles(i, 1) + kTwoPi * chart.shift_v(parent, k);
    }
    for (int k = 0; k < 3; ++k) corner[3 + k] = 0.5 * (corner[k] + corner[(k + 1) % 3]);
    for (int k = 0; k < 3; ++k) {
      corners.row(3 * f + k) = corner[halved.slots(f, k)];
      found.row(halved.faces(f, k)) = corners.row(3 * f + k);  // any branch does
    }
  }
  found.topRows(n) = angles;
  HalvedChart done{std::move(found), Faces(m, 3), Faces(m, 3)};
  for (Index f = 0; f < m; ++f)
    for (int k = 0; k < 3; ++k) {
      const Eigen::RowVector2d turns =
          (corners.row(3 * f + k) - done.angles.row(halved.faces(f, k))) / kTwoPi;
      done.shift_u(f, k) = static_cast<Index>(std::lrint(turns.x()));
      done.shift_v(f, k) = static_cast<Index>(std::lrint(turns.y()));
    }
  return done;
}

IndexRows chart_forms(const mesh::SurfaceTopology& top, const FacesRef& shift_u,
                      const FacesRef& shift_v) {
  const Index m = static_cast<Index>(top.faces.rows());
  if (shift_u.rows() != m || shift_v.rows() != m)
    throw Error("ArrayError", "shifts are needed for each face");
  IndexRows forms = IndexRows::Zero(2, top.edges.rows());
  for (Index f = 0; f < m; ++f)
    for (int k = 0; k < 3; ++k) {
      const Index h = 3 * f + k;
      const int next = (k + 1) % 3;
      if (top.tail(h) > top.head(h)) continue;
      forms(0, top.edge(h)) = shift_u(f, next) - shift_u(f, k);
      forms(1, top.edge(h)) = shift_v(f, next) - shift_v(f, k);
    }
  return forms;
}

}  // namespace stretchmap::area
