// Balance, weight, and agreement of the linear solvers.
#include "fem/statics.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <random>
#include <regex>

#include "cells.h"
#include "fem/interface.h"
#include "gmsh_writer.h"
#include "io/error.h"

namespace acopla::fem::test {
namespace {

constexpr double density = 7850;
const Material steel{2.1e11, 0.3, density};

Vec3 moment(const Mesh& mesh, const Vector& nodal) {
  Vec3 sum = Vec3::Zero();
  for (std::size_t n = 0; n < mesh.nodes(); ++n)
    sum += mesh.points()[n].cross(Vec3(nodal.segment<3>(3 * static_cast<int>(n))));
  return sum;
}

Vector random_loads(const Mesh& mesh) {
  std::mt19937 engine(7);
  std::uniform_real_distribution<double> newtons(-100, 100);
  return Vector::NullaryExpr(3 * static_cast<int>(mesh.nodes()), [&] { return newtons(engine); });
}

Fixed clamped_below(const Mesh& mesh) {
  Fixed fixed(3 * mesh.nodes(), 0);
  hold(mesh.boundary("z0"), {true, true, true}, fixed);
  return fixed;
}

class Balance : public testing::TestWithParam<CellKind> {
 protected:
  Mesh mesh() const {
    const auto [tetrahedra, degree] = GetParam();
    return {write_block("block", {.cells = {3, 3, 3}, .tetrahedra = tetrahedra, .move = distort}),
            degree};
  }
};
INSTANTIATE_TEST_SUITE_P(Cells, Balance, all_kinds(), name_of_kind);

// Loads stand on held nodes as well; these go straight to the supports. 1e-10 of the loads' sum of
// magnitudes: the residual of the solve is round-off times a condition of some 1e4.
TEST_P(Balance, ReactionsBalanceForcesAndMoments) {
  const auto block = mesh();
  const auto fixed = clamped_below(block);
  Statics statics(block, steel, fixed, {});
  statics.prepare();
  const auto load = random_loads(block);
  const auto solution = statics.solve(load);
  const double scale = load.lpNorm<1>();
  EXPECT_LT((total(load, 3) + solution.total_reaction()).norm(), 1e-10 * scale);
  EXPECT_LT((moment(block, load) + moment(block, solution.reaction)).norm(), 1e-10 * scale);
  EXPECT_LT(solution.residual, 1e-13);
}

// Betti: the work of one load on the displacement of another is symmetric.
TEST_P(Balance, WorkIsReciprocal) {
  const auto block = mesh();
  const auto fixed = clamped_below(block);
  Statics statics(block, steel, fixed, {});
  statics.prepare();
  const Vector a = random_loads(block), b = a.reverse();
  const double ab = a.dot(statics.solve(b).displacement);
  const double ba = b.dot(statics.solve(a).displacement);
  EXPECT_NEAR(ab, ba, 1e-10 * std::abs(ab));
}

TEST_P(Balance, WeightIsDensityTimesVolumeTimesGravity) {
  const auto block = mesh();
  const Vec3 gravity(1, 2, -9.81);
  const auto weight = weight_loads(block, steel, gravity);
  EXPECT_LT((total(weight, 3) - density * gravity).norm(), 1e-12 * density * gravity.norm());
}

TEST_P(Balance, DirectAndIterativeSolversAgree) {
  const auto block = mesh();
  const auto fixed = clamped_below(block);
  using Kind = SolverOptions::Kind;
  Statics direct(block, steel, fixed, {.kind = Kind::direct});
  Statics iterative(block, steel, fixed, {.kind = Kind::cg});
  EXPECT_TRUE(direct.solver().direct);
  EXPECT_FALSE(iterative.solver().direct);
  direct.prepare();
  iterative.prepare();
  const auto load = random_loads(block);
  const auto a = direct.solve(load), b = iterative.solve(load);
  // CG stops at a relative residual of 1e-12; the condition of some 1e3 turns it into 1e-9.
  EXPECT_LT((a.displacement - b.displacement).norm(), 1e-9 * a.displacement.norm());
  EXPECT_LT((a.total_reaction() - b.total_reaction()).norm(), 1e-10 * load.lpNorm<1>());
  const auto again = iterative.solve(load, b.displacement);
  EXPECT_LT((again.displacement - b.displacement).norm(), 1e-9 * a.displacement.norm());
}

TEST(Choice, FollowsTheMemoryLimit) {
  const Mesh mesh(write_block("block"), 1);
  const auto fixed = clamped_below(mesh);
  const Statics roomy(mesh, steel, fixed, {});
  EXPECT_TRUE(roomy.solver().direct);
  EXPECT_GT(roomy.solver().factor_bytes, 0);
  EXPECT_NE(roomy.solver().why.find("within the memory limit"), std::string::npos);
  const Statics narrow(mesh, steel, fixed, {.memory_limit = 100});
  EXPECT_FALSE(narrow.solver().direct);
  EXPECT_NE(narrow.solver().why.find("above the memory limit"), std::string::npos);
}

TEST(Statics, OfNoLoadIsNoDisplacement) {
  const Mesh mesh(write_block("block"), 2);
  const auto fixed = clamped_below(mesh);
  for (const auto kind : {SolverOptions::Kind::direct, SolverOptions::Kind::cg}) {
    Statics statics(mesh, steel, fixed, {.kind = kind});
    statics.prepare();
    const auto solution = statics.solve(Vector::Zero(3 * static_cast<int>(mesh.nodes())));
    EXPECT_EQ(solution.displacement.norm(), 0);
    EXPECT_EQ(solution.total_reaction().norm(), 0);
  }
}

// Two factorisations in one process, at different addresses: sums must not depend on these.
TEST(Statics, GivesTheSameBitsEveryTime) {
  const Mesh mesh(write_block("block", {.cells = {7, 7, 7}}), 2);
  const auto fixed = clamped_below(mesh);
  const auto solve = [&] {
    Statics statics(mesh, steel, fixed, {.kind = SolverOptions::Kind::direct});
    statics.prepare();
    return statics.solve(random_loads(mesh)).displacement;
  };
  EXPECT_EQ(solve(), solve());
}

// Two cubes that share an edge: the upper can turn about it, which the rigid modes of the whole do
// not show.
TEST(Statics, RefusesAMechanismAndSaysWhereItIs) {
  const auto path = write_file(
      "hinge.msh",
      "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n2 1 \"z0\"\n$EndPhysicalNames\n"
      "$Nodes\n14\n1 0 0 0\n2 1 0 0\n3 1 1 0\n4 0 1 0\n5 0 0 1\n6 1 0 1\n7 1 1 1\n8 0 1 1\n"
      "9 2 0 1\n10 2 1 1\n11 1 0 2\n12 2 0 2\n13 2 1 2\n14 1 1 2\n$EndNodes\n"
      "$Elements\n3\n1 3 2 1 1 1 2 3 4\n2 5 2 7 7 1 2 3 4 5 6 7 8\n"
      "3 5 2 7 7 6 9 10 7 11 12 13 14\n$EndElements\n");
  const Mesh mesh(path, 1);
  const auto fixed = clamped_below(mesh);
  EXPECT_EQ(free_motions(mesh, fixed), "");
  Statics statics(mesh, steel, fixed, {});
  try {
    statics.prepare();
    FAIL();
  } catch (const io::UserError& error) {
    const std::string text = error.what();
    // Nodes of the upper cube away from the hinge x = z = 1 are what moves, and not along y.
    const std::regex place(
        "The structure is a mechanism: near \\((.+), .+, (.+)\\) it can move along [xz]");
    std::smatch found;
    ASSERT_TRUE(std::regex_search(text, found, place)) << text;
    EXPECT_GE(std::stod(found[1]), 1) << text;
    EXPECT_GE(std::stod(found[2]), 1) << text;
    EXPECT_GT(std::stod(found[1]) + std::stod(found[2]), 2) << text;
  }

  // Conjugate gradients meet no pivot, and converge to something.
  SolverOptions iterations;
  iterations.kind = SolverOptions::Kind::cg;
  Statics iterated(mesh, steel, fixed, iterations);
  iterated.prepare();
  Vector load = mesh.zero();
  load.tail<3>() = Vec3(1e3, 0, 0);
  try {
    iterated.solve(load);
    FAIL();
  } catch (const io::UserError& error) {
    EXPECT_NE(std::string(error.what()).find("the structure is a mechanism"), std::string::npos) << error.what();
  } catch (const std::runtime_error& error) {  // or to nothing
    EXPECT_NE(std::string(error.what()).find("did not converge"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace acopla::fem::test
