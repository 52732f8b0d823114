// What a map to the torus of revolution does to a surface, measured on the polyhedral image.
#pragma once

#include "stretchmap/base/types.hpp"

namespace stretchmap::area {

// The source triangle as the shape terms see it: total area scaled to one.
struct SurfaceReference {
  Vec areas;     // (m) shares of the area
  Points cotan;  // (m, 3) cotangent of the angle at each corner
  Vec weights;   // (m) in energies, summing to one: as the roots of the areas, between one and all
                 // (large faces pay for slivers) and the area (slivers get any ratio)
};

// Triangles with a larger ratio of singular values than `max_aspect`, relative to an equilateral
// one, are given that ratio, their area and axes kept: a needle whose shape is asked to be kept
// forbids its neighbors to change theirs. \pre max_aspect >= 1.
// \throws Error "DegenerateError" for faces without area (ids: faces).
SurfaceReference surface_reference(const PointsRef& points, const FacesRef& faces,
                                   double max_aspect);

struct SurfaceQuality {
  double energy = 0.0;      // mean of (s1^2 + s2^2 + s1^-2 + s2^-2) / 4 over the source's area, s
                            // the singular values of a face's map, areas scaled to total one
  double face_std = 0.0;    // standard deviation of the area ratios
  double angle_mean = 0.0;  // mean of (s1 / s2 + s2 / s1) / 2 over the source's area
  double angle_max = 0.0;
};

// \param image (n, 3); areas are unsigned here.
SurfaceQuality surface_quality(const SurfaceReference& reference, const FacesRef& faces,
                               const PointsRef& image);

}  // namespace stretchmap::area
