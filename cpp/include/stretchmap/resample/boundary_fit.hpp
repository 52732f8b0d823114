// How far the boundary of a hexahedral grid is from a surface, as a sum over samples.
//
//   E(x) = sum_j c_j g(n_j . (sum_i w_ji x_i - y_j) + inward)
//
// over samples j of both: points of each boundary quad against the closest points of the surface,
// and points of the surface against the closest ones of the grid. n_j is the normal of the surface,
// so that points of the grid glide along it at no cost (distance to the tangent plane), turned the
// more into the direction of the gap the longer that is. Quads are
// bilinear; to find their closest points each is replaced by four triangles with its center, which
// long and warped ones are far from: where it matters points are moved on to the quad itself.
#pragma once

#include <vector>

#include "stretchmap/maps/surface_tree.hpp"

namespace stretchmap::resample {

// Of each sample: the corners of its quad and their weights, and the point and normal of the
// surface; c_j before the strength is put in, so that they add up to one over the quads' samples
// and to one over the surface's.
struct FitSamples {
  Tets corners;  // (s, 4)
  Rows weights;  // (s, 4)
  Points point, normal;
  Vec share;     // (s) of its half of the area; 0 if the two surfaces face opposite ways
  Vec distance;  // (s) between the two points
  Index first_of_surface = 0;
};

class BoundaryFit {
 public:
  // \param points,faces,normals of the surface: (n, 3), (m, 3), outward unit normals of the
  // vertices
  //        (n, 3).
  // \param sample_faces,sample_weights samples of it by face (s) and barycentric coordinates (s,
  // 3),
  //        each standing for the same area.
  // \param quads (q, 4) of the grid, seen from outside; per_side^2 samples are taken of each,
  //        those on its edges and corners together with its neighbors, per_side > 1.
  // \param far gaps this long are closed half-way between the normal and their own direction.
  // \param bilinear closest points of the grid are moved from the triangles to the quads.
  BoundaryFit(const PointsRef& points, const FacesRef& faces, const PointsRef& normals,
              const IndexVecRef& sample_faces, const PointsRef& sample_weights,
              const TetsRef& quads, int per_side, double far, bool bilinear = false);

  // \param x points of the grid.
  // \return their samples. Each begins to look for its closest point where it was the last time.
  FitSamples match(const PointsRef& x);

 private:
  Eigen::RowVector3d normal(Index face, const Eigen::Vector3d& weights) const;
  Eigen::RowVector3d direction(const Eigen::RowVector3d& normal,
                               const Eigen::RowVector3d& gap) const;
  void find_places();
  void match_quads(const PointsRef& x, FitSamples& out);
  void match_surface(const PointsRef& x, FitSamples& out);

  maps::SurfaceTree surface_;
  Points normals_;
  Points sites_, site_normals_;
  Tets quads_;
  struct Place {  // the first of the quads that have this sample, and its number there
    Index quad;
    int sample;
  };
  std::vector<Place> places_;
  std::vector<Index> place_of_;  // (q per_side^2)
  std::vector<Index> near_;      // of each sample the face closest to it the last time
  int per_side_;
  double far_;
  bool bilinear_;
};

}  // namespace stretchmap::resample
