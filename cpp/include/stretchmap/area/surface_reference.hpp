// The source as maps of a surface see it, and what they do to its angles.
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

// \param image (n, 3); areas are unsigned here.
// \return mean of (s1 / s2 + s2 / s1) / 2 over the source's area, s the singular values of a face's
//         map: one where all angles are kept.
double mean_angle_distortion(const SurfaceReference& reference, const FacesRef& faces,
                             const PointsRef& image);

}  // namespace stretchmap::area
