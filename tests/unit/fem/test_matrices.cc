// Rows of matrices by themselves, and the condition of systems.
#include "fem/matrices.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "cells.h"
#include "fem/condition.h"
#include "fem/elasticity.h"
#include "gmsh_writer.h"

namespace acopla::fem::test {
namespace {

const Material steel{2.1e11, 0.3, 7850};

class Rows : public testing::TestWithParam<CellKind> {};
INSTANTIATE_TEST_SUITE_P(Cells, Rows, all_kinds(), name_of_kind);

// Bit for bit, as the same cells are added in the same order.
TEST_P(Rows, OfAShareAreThoseOfTheWhole) {
  const auto [tetrahedra, degree] = GetParam();
  const Mesh mesh(write_block("rows", {.cells = {3, 2, 2}, .tetrahedra = tetrahedra, .move = distort}), degree);
  const auto whole = assemble_stiffness(mesh, steel);
  const auto whole_mass = assemble_mass(mesh, steel, {}, whole.pattern());
  std::vector<char> rows(mesh.nodes(), 0);
  for (std::size_t n = 0; n < rows.size(); n += 3) rows[n] = 1;
  const auto pattern = std::make_shared<CoupledNodes>(mesh.nodes(), mesh.cell_nodes(), static_cast<std::size_t>(mesh.element().nodes), rows);
  const auto share = assemble_stiffness(mesh, steel, {}, pattern);
  const auto share_mass = assemble_mass(mesh, steel, {}, pattern);
  for (std::size_t n = 0; n < mesh.nodes(); ++n) {
    ASSERT_EQ(pattern->has(n), rows[n] == 1);
    if (!rows[n]) continue;
    const auto near = share.row(n);
    ASSERT_TRUE(std::equal(near.begin(), near.end(), whole.row(n).begin(), whole.row(n).end()));
    EXPECT_TRUE(std::equal(share.block(n, 0), share.block(n, 0) + 9 * near.size(), whole.block(n, 0)));
    EXPECT_TRUE(std::equal(share_mass.values().data() + pattern->start(n), share_mass.values().data() + pattern->start(n + 1),
                           whole_mass.values().data() + whole.pattern()->start(n)));
  }
  EXPECT_LT(share.bytes(), 0.5 * whole.bytes());
}

// λ_k = k² of 1 … 200², but for held ones, which would change both ends.
TEST(Condition, IsThatOfFreeUnknowns) {
  constexpr Eigen::Index size = 202;
  Vector lambda(size);
  for (Eigen::Index k = 0; k < size; ++k) lambda[k] = static_cast<double>(k * k) + (k == 0 ? 1e-6 : 0);
  Fixed fixed(size, 0);
  fixed.front() = fixed.back() = 1;
  const double kappa = condition_number([&](const Vector& x, Vector& y) { y = lambda.cwiseProduct(x); },
                                        [&](const Vector& x, Vector& y) { y = x.cwiseQuotient(lambda); }, fixed);
  EXPECT_NEAR(kappa, 200.0 * 200.0, 0.03 * 200 * 200);
  EXPECT_LT(kappa, 200.0 * 200.0 * (1 + 1e-10));
}

// A mass alone: the solver of k K + m M that a motion asks for.
TEST(LocalMatricesTest, SolveWithSums) {
  const Mesh mesh(write_block("sums", {.cells = {2, 2, 2}}), 1);
  const auto K = assemble_stiffness(mesh, steel);
  const auto M = assemble_mass(mesh, steel, {}, K.pattern());
  Fixed fixed(mesh.unknowns(), 0);
  hold(mesh.boundary("z0"), {true, true, true}, fixed);
  const LocalMatrices matrices(mesh, fixed, K, &M);
  const auto chosen = matrices.solver(0.5, 3e9, {});
  chosen.solver->prepare();
  Vector exact = mesh.zero(), f, product, u;
  for (Eigen::Index i = 0; i < exact.size(); ++i)
    if (!fixed[static_cast<std::size_t>(i)]) exact[i] = static_cast<double>(i % 7) - 3;
  matrices.stiffness(0.5 * exact, f);
  matrices.mass(3e9 * exact, product);
  chosen.solver->solve(f + product, u);
  EXPECT_LT((u - exact).lpNorm<Eigen::Infinity>(), 1e-10);
}

}  // namespace
}  // namespace acopla::fem::test
