// Vector proxies of 1-forms.
#include <doctest/doctest.h>

#include <Eigen/Geometry>
#include <cmath>

#include "stretchmap/forms/hodge.hpp"
#include "support/shapes.hpp"

TEST_SUITE_BEGIN("forms");

using namespace stretchmap;
using Eigen::RowVector3d;

TEST_CASE("the vector proxy of a closed form is tangent and gives the form back") {
  const tests::WavyTorus torus = tests::wavy_torus(12, 9);
  const mesh::SurfaceTopology& top = torus.topology;
  Vec form(top.edges.rows());  // the coordinate along the axis, whole turns left out
  for (Index e = 0; e < form.size(); ++e) {
    const double change = torus.turns(top.edges(e, 1), 0) - torus.turns(top.edges(e, 0), 0);
    form[e] = change - std::round(change);
  }
  const Points vectors = forms::form_vectors(top, torus.points, form);
  for (Index f = 0; f < top.faces.rows(); ++f) {
    RowVector3d edge[2];
    for (int k = 0; k < 3; ++k) {
      const Index h = 3 * f + k;
      const RowVector3d along = torus.points.row(top.head(h)) - torus.points.row(top.tail(h));
      CHECK(along.dot(vectors.row(f)) ==
            doctest::Approx(top.sign(h) * form[top.edge[h]]).epsilon(1e-12));
      if (k < 2) edge[k] = along;
    }
    const RowVector3d normal = edge[0].cross(edge[1]).normalized();
    CHECK(std::abs(normal.dot(vectors.row(f))) < 1e-12);
  }
}

TEST_SUITE_END();
