#include "geometry/triangle.h"

namespace acopla::geometry {
namespace {

NearestOnTriangle result(const Vec3& x, const Vec3& a, const Vec3& b, const Vec3& c, std::array<double, 3> weights,
                         TriangleFeature feature) {
  const Vec3 point = weights[0] * a + weights[1] * b + weights[2] * c;
  return {weights, point, (x - point).squaredNorm(), feature};
}

}  // namespace

NearestOnTriangle nearest_on_triangle(const Vec3& x, const Vec3& a, const Vec3& b, const Vec3& c) {
  using F = TriangleFeature;
  const Vec3 ab = b - a, ac = c - a, ax = x - a;
  const double d1 = ab.dot(ax), d2 = ac.dot(ax);
  if (d1 <= 0 && d2 <= 0) return result(x, a, b, c, {1, 0, 0}, F::vertex0);

  const Vec3 bx = x - b;
  const double d3 = ab.dot(bx), d4 = ac.dot(bx);
  if (d3 >= 0 && d4 <= d3) return result(x, a, b, c, {0, 1, 0}, F::vertex1);

  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) {
    const double v = d1 / (d1 - d3);
    return result(x, a, b, c, {1 - v, v, 0}, F::edge0);
  }

  const Vec3 cx = x - c;
  const double d5 = ab.dot(cx), d6 = ac.dot(cx);
  if (d6 >= 0 && d5 <= d6) return result(x, a, b, c, {0, 0, 1}, F::vertex2);

  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) {
    const double w = d2 / (d2 - d6);
    return result(x, a, b, c, {1 - w, 0, w}, F::edge2);
  }

  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
    const double w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
    return result(x, a, b, c, {0, 1 - w, w}, F::edge1);
  }

  const double scale = 1 / (va + vb + vc);
  const double v = vb * scale, w = vc * scale;
  return result(x, a, b, c, {1 - v - w, v, w}, F::face);
}

}  // namespace acopla::geometry
