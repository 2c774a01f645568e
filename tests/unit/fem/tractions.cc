#include "tractions.h"

#include <Eigen/Geometry>
#include <cmath>

namespace acopla::fem::test {
namespace {

using geometry::FaceKind;
using Shape = Eigen::VectorXd;

/// Lagrange polynomials of second order on −1, 0, 1.
double lagrange(int i, double x) {
  return i < 0 ? 0.5 * x * (x - 1) : i > 0 ? 0.5 * x * (x + 1) : 1 - x * x;
}

Shape quad(FaceKind kind, double s, double t) {
  constexpr int at[9][2] = {{-1, -1}, {1, -1}, {1, 1},  {-1, 1}, {0, -1},
                            {1, 0},   {0, 1},  {-1, 0}, {0, 0}};
  Shape shape(kind == FaceKind::quad9 ? 9 : 4);
  for (int a = 0; a < shape.size(); ++a)
    shape[a] = kind == FaceKind::quad9 ? lagrange(at[a][0], s) * lagrange(at[a][1], t)
                                       : 0.25 * (1 + at[a][0] * s) * (1 + at[a][1] * t);
  return shape;
}

Shape triangle(FaceKind kind, double s, double t) {
  const double l[] = {1 - s - t, s, t};
  Shape shape(kind == FaceKind::triangle6 ? 6 : 3);
  for (int a = 0; a < 3; ++a) {
    shape[a] = kind == FaceKind::triangle6 ? l[a] * (2 * l[a] - 1) : l[a];
    if (kind == FaceKind::triangle6) shape[3 + a] = 4 * l[a] * l[(a + 1) % 3];
  }
  return shape;
}

Shape shape_at(FaceKind kind, double s, double t) {
  return geometry::corners_of(kind) == 4 ? quad(kind, s, t) : triangle(kind, s, t);
}

}  // namespace

void integrate(const geometry::SurfaceMesh& surface, std::size_t face,
               const std::function<void(const Shape&, const Vec3&, const Vec3&)>& visit) {
  const auto kind = surface.kind(face);
  const bool is_quad = geometry::corners_of(kind) == 4;
  Eigen::Matrix3Xd x(3, std::ssize(surface.nodes(face)));
  for (int a = 0; a < x.cols(); ++a)
    x.col(a) = surface.points[surface.nodes(face)[static_cast<std::size_t>(a)]];
  const double gauss[] = {-std::sqrt(0.6), 0, std::sqrt(0.6)}, weights[] = {5. / 9, 8. / 9, 5. / 9};
  constexpr double h = 1e-3;  // central differences are exact for polynomials of second order
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      double s = gauss[i], t = gauss[j], weight = weights[i] * weights[j];
      if (!is_quad) {  // Duffy: the square collapsed to the triangle
        s = 0.5 * (1 + gauss[i]);
        t = 0.5 * (1 + gauss[j]) * (1 - s);
        weight *= 0.25 * (1 - s);
      }
      const Vec3 ds = x * (shape_at(kind, s + h, t) - shape_at(kind, s - h, t)) / (2 * h);
      const Vec3 dt = x * (shape_at(kind, s, t + h) - shape_at(kind, s, t - h)) / (2 * h);
      const auto shape = shape_at(kind, s, t);
      visit(shape, x * shape, weight * ds.cross(dt));
    }
}

std::vector<Vec3> traction_loads(const geometry::SurfaceMesh& surface,
                                 const std::function<Vec3(const Vec3&, const Vec3&)>& traction) {
  std::vector<Vec3> loads(surface.points.size(), Vec3::Zero());
  for (std::size_t f = 0; f < surface.face_count(); ++f)
    integrate(surface, f, [&](const Shape& shape, const Vec3& point, const Vec3& area) {
      const Vec3 force = traction(point, area.normalized()) * area.norm();
      for (int a = 0; a < shape.size(); ++a)
        loads[surface.nodes(f)[static_cast<std::size_t>(a)]] += shape[a] * force;
    });
  return loads;
}

}  // namespace acopla::fem::test
