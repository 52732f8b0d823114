// The surface that boundary vertices glide on, as the optimizer sees it: axes, how they turn, and
// how a point moves. Nothing else in this folder knows what surface it is.
#pragma once

#include <vector>

#include "stretchmap/base/torus.hpp"

namespace stretchmap::volume {

class GlideSurface {
 public:
  virtual ~GlideSurface() = default;

  // \return where on the surface a point of it is: what the functions below take as `place`, so
  // that they need not look for it. Of a point near the surface, the place of one close by serves.
  virtual Index place(const Eigen::Vector3d& x) const = 0;

  // \return orthonormal axes at a point of the surface, as columns: two along it, then the outward
  //         normal.
  virtual Eigen::Matrix3d frame(const Eigen::Vector3d& x, Index place) const = 0;

  // \return unit vector that points outward; the normal for a point of the surface, and smooth near
  // it, so that it serves for points of the flat triangles between its vertices, too.
  virtual Eigen::Vector3d outward(const Eigen::Vector3d& x, Index place) const = 0;
  virtual Eigen::Matrix3d outward_derivative(const Eigen::Vector3d& x, Index place) const = 0;

  // \return where a point of the surface comes to by a step along the first two axes of its frame.
  virtual Eigen::Vector3d moved(const Eigen::Vector3d& x, Index place,
                                const Eigen::Vector2d& step) const = 0;

  // \param g a gradient at x, in its frame.
  // \return second derivatives of `moved` by the step at zero, in the direction g: what it adds to
  //         the Hessian because the surface is curved.
  virtual Eigen::Matrix2d bending(const Eigen::Vector3d& x, Index place,
                                  const Eigen::Vector3d& g) const = 0;

  // \return whether the outward direction varies little between the corners of a triangle.
  virtual bool smooth() const = 0;

  // \return total area, the scale of the boundary's rest triangles.
  virtual double area() const = 0;
};

// What the surface has at one vertex.
struct GlideSite {
  Index place = -1;
  Eigen::Vector3d outward;
  Eigen::Matrix3d frame, turn;  // turn: outward_derivative
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
GlideSites sites_at(const GlideSurface& surface, const PointsRef& x,
                    const std::vector<Index>& vertices, const IndexVec& number, bool derivatives);

// ((R + r cos v) cos u, (R + r cos v) sin u, r sin v), 0 < r < R. The axes are those of u and v,
// steps are arc lengths along these two circles, and outward is away from the core circle. A place
// has no meaning here.
class TorusSurface final : public GlideSurface {
 public:
  TorusSurface(double R, double r);

  Index place(const Eigen::Vector3d& x) const override;
  Eigen::Matrix3d frame(const Eigen::Vector3d& x, Index place) const override;
  Eigen::Vector3d outward(const Eigen::Vector3d& x, Index place) const override;
  Eigen::Matrix3d outward_derivative(const Eigen::Vector3d& x, Index place) const override;
  Eigen::Vector3d moved(const Eigen::Vector3d& x, Index place,
                        const Eigen::Vector2d& step) const override;
  Eigen::Matrix2d bending(const Eigen::Vector3d& x, Index place,
                          const Eigen::Vector3d& g) const override;
  bool smooth() const override { return true; }
  double area() const override;

 private:
  Torus torus_;
};

}  // namespace stretchmap::volume
