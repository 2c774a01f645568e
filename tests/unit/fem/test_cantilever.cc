#include <gtest/gtest.h>

#include "fem/interface.h"
#include "fem/statics.h"
#include "gmsh_writer.h"
#include "tractions.h"

namespace acopla::fem::test {
namespace {

/// Deflection [m] of the end of a clamped bar along x under a shear force spread over its end.
double deflection(const Vec3& size, const std::array<int, 3>& cells, int degree, double young,
                  double force) {
  const Mesh mesh(write_block("bar", {.size = size, .cells = cells}), degree);
  Fixed fixed(3 * mesh.nodes(), 0);
  hold(mesh.boundary("x0"), {true, true, true}, fixed);
  Statics statics(mesh, Material{young, 0.0, {}}, fixed, {});
  statics.prepare();
  const Interface end(mesh, "x1");
  Vector load = Vector::Zero(3 * static_cast<int>(mesh.nodes()));
  const Vec3 traction(0, 0, force / (size[1] * size[2]));
  end.add_forces(traction_loads(end.surface(), [&](const Vec3&, const Vec3&) { return traction; }),
                 load);
  const auto moved = end.values(statics.solve(load).displacement);
  double sum = 0;
  for (const auto& u : moved) sum += u[2];
  return sum / static_cast<double>(moved.size());
}

/// Timoshenko: P L³ / (3 E I) + P L / (k G A) with k = 5/6.
double timoshenko(const Vec3& size, double young, double force) {
  const double length = size[0], area = size[1] * size[2], shear = young / 2;
  const double inertia = size[1] * size[2] * size[2] * size[2] / 12;
  return force * std::pow(length, 3) / (3 * young * inertia) +
         force * length / (5.0 / 6.0 * shear * area);
}

// With ν = 0 the clamp holds no contraction, and beam theory differs from the solid by what a clamp
// that keeps the section plane and a uniform end load do within a depth of the ends: some
// (h/L)² = 1 % of the shear's 0.5 % share and the discretisation's error, together below 2e-3.
TEST(Cantilever, OfSecondOrderCellsDeflectsAsTimoshenkoSays) {
  const Vec3 size(1, 0.1, 0.1);
  const double exact = timoshenko(size, 2.1e11, 1000);
  EXPECT_NEAR(deflection(size, {10, 1, 2}, 2, 2.1e11, 1000), exact, 2e-3 * exact);
}

// First-order cells lock in bending and come from below; halving the cells quarters the error.
TEST(Cantilever, OfFirstOrderCellsConvergesFromBelowWithOrderTwo) {
  const Vec3 size(1, 0.1, 0.1);
  const double exact = timoshenko(size, 2.1e11, 1000);
  const double coarse = 1 - deflection(size, {40, 1, 4}, 1, 2.1e11, 1000) / exact;
  const double fine = 1 - deflection(size, {80, 1, 8}, 1, 2.1e11, 1000) / exact;
  EXPECT_GT(fine, 0);
  EXPECT_NEAR(std::log2(coarse / fine), 2, 0.15);
}

}  // namespace
}  // namespace acopla::fem::test
