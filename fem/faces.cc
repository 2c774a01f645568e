#include "fem/faces.h"

#include <Eigen/Geometry>
#include <array>
#include <cmath>

namespace acopla::fem {
namespace {

using geometry::FaceKind;

/// Shape functions and their slopes along one or two reference coordinates.
struct Basis {
  Eigen::VectorXd value, u, v;
};

/// Lagrange polynomials of a line on [−1, 1] with nodes at −1, 1 and (second order) 0.
struct Line {
  Line(double t, bool quadratic) {
    if (quadratic) {
      value = {0.5 * t * (t - 1), 0.5 * t * (t + 1), 1 - t * t};
      slope = {t - 0.5, t + 0.5, -2 * t};
    } else {
      value = {0.5 * (1 - t), 0.5 * (1 + t), 0};
      slope = {-0.5, 0.5, 0};
    }
  }
  std::array<double, 3> value, slope;
};

Basis quadrilateral(int nodes, double s, double t) {
  // Which of a line's nodes each node takes along either coordinate.
  static constexpr std::size_t along[9][2] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}, {2, 0},
                                              {1, 2}, {2, 1}, {0, 2}, {2, 2}};
  const Line a(s, nodes == 9), b(t, nodes == 9);
  Basis basis{Eigen::VectorXd(nodes), Eigen::VectorXd(nodes), Eigen::VectorXd(nodes)};
  for (int n = 0; n < nodes; ++n) {
    const auto i = along[n][0], j = along[n][1];
    basis.value[n] = a.value[i] * b.value[j];
    basis.u[n] = a.slope[i] * b.value[j];
    basis.v[n] = a.value[i] * b.slope[j];
  }
  return basis;
}

Basis triangle(int nodes, double s, double t) {
  const double l[3] = {1 - s - t, s, t}, u[3] = {-1, 1, 0}, v[3] = {-1, 0, 1};
  Basis basis{Eigen::VectorXd(nodes), Eigen::VectorXd(nodes), Eigen::VectorXd(nodes)};
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3;
    basis.value[i] = nodes == 3 ? l[i] : l[i] * (2 * l[i] - 1);
    basis.u[i] = nodes == 3 ? u[i] : u[i] * (4 * l[i] - 1);
    basis.v[i] = nodes == 3 ? v[i] : v[i] * (4 * l[i] - 1);
    if (nodes == 3) continue;
    basis.value[3 + i] = 4 * l[i] * l[j];
    basis.u[3 + i] = 4 * (u[i] * l[j] + l[i] * u[j]);
    basis.v[3 + i] = 4 * (v[i] * l[j] + l[i] * v[j]);
  }
  return basis;
}

// Three Gauss points a direction: exact to degree 5, where two shape functions of second order
// make 4.
const double gauss_point[] = {-std::sqrt(0.6), 0, std::sqrt(0.6)};
constexpr double gauss_weight[] = {5. / 9, 8. / 9, 5. / 9};

void visit_line(const Mesh& mesh, const Eigen::Matrix3Xd& x,
                const std::function<void(const FacePoint&)>& visit) {
  for (int i = 0; i < 3; ++i) {
    const Line line(gauss_point[i], x.cols() == 3);
    Eigen::VectorXd shape(x.cols());
    Vec3 along = Vec3::Zero();
    for (int a = 0; a < x.cols(); ++a) {
      shape[a] = line.value[static_cast<std::size_t>(a)];
      along += gauss_weight[i] * line.slope[static_cast<std::size_t>(a)] * x.col(a);
    }
    visit({shape, x * shape,
           mesh.dimension() == 2 ? Vec3(along[1], -along[0], 0) : Vec3(along.norm(), 0, 0)});
  }
}

}  // namespace

void visit_face(const Mesh& mesh, const BoundaryFace& face,
                const std::function<void(const FacePoint&)>& visit) {
  const auto nodes = face.used();
  const auto count = static_cast<int>(nodes.size());
  Eigen::Matrix3Xd x(3, count);
  for (int a = 0; a < count; ++a) x.col(a) = mesh.points()[nodes[static_cast<std::size_t>(a)]];
  const auto corners = geometry::corners_of(face.kind);
  if (corners == 2) return visit_line(mesh, x, visit);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      double s = gauss_point[i], t = gauss_point[j], weight = gauss_weight[i] * gauss_weight[j];
      if (corners == 3) {  // the square collapsed to a triangle (Duffy 1982)
        s = 0.5 * (1 + gauss_point[i]);
        t = 0.5 * (1 + gauss_point[j]) * (1 - s);
        weight *= 0.25 * (1 - s);
      }
      const auto basis = corners == 3 ? triangle(count, s, t) : quadrilateral(count, s, t);
      const Vec3 along_s = x * basis.u, along_t = x * basis.v;
      visit({basis.value, x * basis.value, weight * along_s.cross(along_t)});
    }
}

double measure(const Mesh& mesh, const std::vector<BoundaryFace>& faces) {
  double sum = 0;
  for (const auto& face : faces)
    visit_face(mesh, face, [&](const FacePoint& point) { sum += point.area.norm(); });
  return sum;
}

}  // namespace acopla::fem
