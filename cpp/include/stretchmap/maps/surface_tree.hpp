// The point of a surface closest to any point: a tree of boxes over its faces.
#pragma once

#include <array>
#include <vector>

#include "stretchmap/base/types.hpp"

namespace stretchmap::maps {

struct Foot {
  Index face = -1;
  Eigen::Vector3d point, weights;  // on the surface, and its barycentric coordinates in the face
  double squared_distance = 0.0;
};

// The same of n points.
struct SurfaceFeet {
  Points points;   // (n, 3)
  IndexVec face;   // (n)
  Points weights;  // (n, 3)
};

class SurfaceTree {
 public:
  // \param points,faces (n, 3) and (m, 3), copied.
  // \pre m > 0
  SurfaceTree(const PointsRef& points, const FacesRef& faces);

  // \param queries (n, 3)
  // \return their closest points.
  SurfaceFeet feet(const PointsRef& queries, const Poll& poll = {}) const;

  // \param hint a face to begin with: any is right, a near one is faster.
  // \return the closest point.
  Foot closest(const Eigen::Vector3d& query, Index hint = 0) const;

  // \return the point of one face closest to a query.
  Foot on_face(const Eigen::Vector3d& query, Index face) const;

  const Points& points() const { return points_; }
  const Faces& faces() const { return faces_; }

 private:
  struct Node {
    Eigen::Array3d low, high;
    Index first, last;  // faces in order_ of a leaf; of an inner node the second child is `last`
    bool leaf;
  };
  Index build(Index first, Index last, std::vector<Eigen::Array3d>& centers);

  Points points_;
  Faces faces_;
  std::vector<Index> order_;
  std::vector<Node> nodes_;  // the first child of node k is k + 1
};

}  // namespace stretchmap::maps
