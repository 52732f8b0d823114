// The surface that boundary vertices glide on, as the optimizer sees it: axes, how they turn, and
// how a point moves. Nothing else in this folder knows what surface it is.
#pragma once

#include <vector>

#include "stretchmap/base/torus.hpp"

namespace stretchmap::volume {

// What the surface has at one vertex.
struct GlideSite {
  Index place = -1;
  Eigen::Vector3d outward;
  Eigen::Matrix3d frame, turn;  // turn: outward_derivative
};

class GlideSurface {
 public:
  virtual ~GlideSurface() = default;

  // \return where on the surface a point of it is: what the functions below take as `place`, so
  // that they need not look for it. Of a point near the surface, the place of one close by serves.
  // \param hint the place of a point close by, looked at first; -1: none is known.
  virtual Index place(const Eigen::Vector3d& x, Index hint) const = 0;
  Index place(const Eigen::Vector3d& x) const { return place(x, -1); }

  // \return orthonormal axes at a point of the surface, as columns: two along it, then the outward
  //         normal.
  virtual Eigen::Matrix3d frame(const Eigen::Vector3d& x, Index place) const = 0;

  // \return unit vector that points outward; the normal for a point of the surface, and smooth near
  // it, so that it serves for points of the flat triangles between its vertices, too.
  virtual Eigen::Vector3d outward(const Eigen::Vector3d& x, Index place) const = 0;
  virtual Eigen::Matrix3d outward_derivative(const Eigen::Vector3d& x, Index place) const = 0;

  // All of these that are kept of a vertex, found together.
  // \param derivatives whether frame and turn are wanted.
  virtual GlideSite site(const Eigen::Vector3d& x, Index hint, bool derivatives) const;

  // \return where a point of the surface comes to by a step along the first two axes of its frame.
  virtual Eigen::Vector3d moved(const Eigen::Vector3d& x, Index place,
                                const Eigen::Vector2d& step) const = 0;

  // \param site that of x, with derivatives.
  // \param g a gradient at x, in its frame.
  // \return second derivatives of `moved` by the step at zero, in the direction g: what it adds to
  //         the Hessian because the surface is curved.
  virtual Eigen::Matrix2d bending(const Eigen::Vector3d& x, const GlideSite& site,
                                  const Eigen::Vector3d& g) const = 0;

  // \return whether the outward direction varies little between the corners of a triangle.
  virtual bool smooth() const = 0;

  // \return total area, the scale of the boundary's rest triangles.
  virtual double area() const = 0;
};

// The same at all vertices on the surface, looked up once for all that an evaluation asks.
struct GlideSites {
  const IndexVec& number;     // (n) of each vertex among the sites, -1 off the surface
  std::vector<GlideSite> at;  // frame and turn only where derivatives are wanted

  const GlideSite& operator()(Index vertex) const { return at[number[vertex]]; }
};

// \param x (n, 3)
// \param vertices those on the surface.
// \param number (n) as in the result, which refers to it.
// \param places where the vertices were when last looked for, and then where they are; as long as
//        there are vertices, or empty if nothing is known.
GlideSites sites_at(const GlideSurface& surface, const PointsRef& x,
                    const std::vector<Index>& vertices, const IndexVec& number, bool derivatives,
                    std::vector<Index>& places);
GlideSites sites_at(const GlideSurface& surface, const PointsRef& x,
                    const std::vector<Index>& vertices, const IndexVec& number, bool derivatives);

// ((R + r cos v) cos u, (R + r cos v) sin u, r sin v), 0 < r < R. The axes are those of u and v,
// steps are arc lengths along these two circles, and outward is away from the core circle. A place
// has no meaning here.
class TorusSurface final : public GlideSurface {
 public:
  TorusSurface(double R, double r);

  using GlideSurface::place;
  Index place(const Eigen::Vector3d& x, Index hint) const override;
  Eigen::Matrix3d frame(const Eigen::Vector3d& x, Index place) const override;
  Eigen::Vector3d outward(const Eigen::Vector3d& x, Index place) const override;
  Eigen::Matrix3d outward_derivative(const Eigen::Vector3d& x, Index place) const override;
  Eigen::Vector3d moved(const Eigen::Vector3d& x, Index place,
                        const Eigen::Vector2d& step) const override;
  Eigen::Matrix2d bending(const Eigen::Vector3d& x, const GlideSite& site,
                          const Eigen::Vector3d& g) const override;
  bool smooth() const override { return true; }
  double area() const override;

 private:
  Torus torus_;
};

}  // namespace stretchmap::volume
