// What a piecewise-affine map does to each of its elements, in one pass: sizes before and after,
// with sign, and the distortion of angles. Sums over vertex rings for (6.2)-(6.5).
#pragma once

#include "stretchmap/base/types.hpp"

namespace stretchmap::measures {

struct ElementMeasures {
  Vec source;     // (m) area (faces) or signed volume (tets) in the source
  Vec image;      // (m) the same in the image, signed
  Vec angle;      // (m) distortion of angles, >= 1 and 1 for a similarity; infinity where the image
                  //     does not have positive size. Faces: ratio of the singular values of the
                  //     affine map. Tets: tr(J^T J) / (3 det(J)^(2/3)).
  Vec conformal;  // (m) faces: the face's share of the conformal energy (6.1),
                  //     area * (s1 -+ s2)^2 / 2 with + where it is flipped; tets: empty
};

// Faces of a surface mapped by points -> image.
// \param sign (m) +1 where the image face is positively oriented, -1 where it is flipped, 0 where
//        that cannot be told apart (its image area then counts as zero).
ElementMeasures face_measures(const PointsRef& points, const FacesRef& faces,
                              const PointsRef& image, const VecRef& sign);

// \param points,image (n, 3) each.
// \return sizes are signed volumes, det(v1-v0, v2-v0, v3-v0) / 6.
ElementMeasures tet_measures(const PointsRef& points, const TetsRef& tets, const PointsRef& image);

// (n) sum of the values of the elements around each vertex, in the order of the elements.
// elements: (m, 3) or (m, 4). \pre ids in [0, n_vertices), values of length m.
Vec ring_sums(const Eigen::Ref<const IndexRows>& elements, const VecRef& values, Index n_vertices);

// Standard deviations of the ratios of shares of the total, image to source.
struct ShareDeviations {
  double rings = 0.0, elements = 0.0;
};

// \param source (m) sizes of the elements, `rings` (n) their ring_sums; `image` (m) sizes there.
ShareDeviations share_deviations(const Eigen::Ref<const IndexRows>& elements, const VecRef& source,
                                 const VecRef& rings, const VecRef& image);

// Sum of d d' / (d' metric d) over the rows d of `directions`.
Eigen::Matrix3d direction_scatter(const PointsRef& directions, const Eigen::Matrix3d& metric);

}  // namespace stretchmap::measures
