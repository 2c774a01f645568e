// Accelerations on fixed points that are known.
#include "coupler/acceleration/acceleration.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <random>

namespace acopla::coupler {
namespace {

using Vector = Acceleration::Vector;

// H(x) = A x + b.
struct Linear {
  Eigen::MatrixXd a;
  Vector b;
  Vector operator()(const Vector& x) const { return a * x + b; }
  Vector fixed_point() const { return (Eigen::MatrixXd::Identity(a.rows(), a.cols()) - a).inverse() * b; }
};

// Slopes of size 3: plain iteration would blow up.
Linear strong(int size) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  Linear linear{Eigen::MatrixXd(size, size), Vector(size)};
  for (auto& value : linear.a.reshaped()) value = normal(random);
  for (auto& value : linear.b) value = normal(random);
  linear.a *= -3 / linear.a.operatorNorm();
  return linear;
}

// Calls of H until the residual is below a part of the first one; 1000: not.
template <class Map>
int calls(Acceleration& acceleration, const Map& map, Vector x, double part) {
  acceleration.begin_window();
  const double first = (map(x) - x).norm();
  for (int n = 1; n < 1000; ++n) {
    const Vector answered = map(x);
    if ((answered - x).norm() <= part * first) {
      acceleration.end_window();
      return n;
    }
    x = acceleration.next(x, answered);
  }
  return 1000;
}

// The least-squares model of a linear map of n unknowns is exact with n differences: n + 1 calls for them, one relaxed step before, one to see it.
TEST(QuasiNewton, SolvesALinearMapWithADifferenceForEveryUnknown) {
  for (const int size : {1, 2, 5, 12}) {
    InterfaceQuasiNewton quasi_newton({});
    EXPECT_LE(calls(quasi_newton, strong(size), Vector::Zero(size), 1e-9), size + 2) << size;
  }
}

TEST(QuasiNewton, WhatItKeepsOfTheLastWindowSavesIterations) {
  const auto map = strong(5);
  for (const int reuse : {0, 1}) {
    InterfaceQuasiNewton quasi_newton({.reuse = reuse});
    const int first = calls(quasi_newton, map, Vector::Zero(5), 1e-9);
    EXPECT_EQ(quasi_newton.columns() > 0, reuse > 0);
    const int second = calls(quasi_newton, map, Vector::Ones(5), 1e-9);
    if (reuse) {
      EXPECT_LE(second, 3);  // a relaxed step no more: the model is known
    } else {
      EXPECT_EQ(second, first);
    }
  }
}

TEST(QuasiNewton, ColumnsThatAddNothingAreDropped) {
  InterfaceQuasiNewton quasi_newton({});
  const Vector x = Vector::Zero(3);
  quasi_newton.begin_window();
  EXPECT_EQ(quasi_newton.next(x, x), x);  // nothing moved
  EXPECT_EQ(quasi_newton.next(x, x), x);
  EXPECT_EQ(quasi_newton.columns(), 0u);
}

// Beyond x = 1 the map is another one, as where a contact opens. A model of the one side must not be believed on the other.
TEST(QuasiNewton, ForgetsWhereTheResidualStrays) {
  InterfaceQuasiNewton quasi_newton({});
  quasi_newton.begin_window();
  Vector x(1), answered(1);
  for (const auto& [at, residual] : {std::pair{0.0, 1.0}, {0.5, 0.6}}) {
    x[0] = at, answered[0] = at + residual;
    quasi_newton.next(x, answered);
  }
  EXPECT_EQ(quasi_newton.columns(), 1u);
  x[0] = 1.3, answered[0] = 1.3 - 2;  // more than twice the least residual
  EXPECT_DOUBLE_EQ(quasi_newton.next(x, answered)[0], 1.3 - 0.5 * 2);
  EXPECT_EQ(quasi_newton.columns(), 0u);
}

// One unknown: two residuals give the line, and the third call is at the fixed point.
TEST(Aitken, SolvesALinearMapOfOneUnknown) {
  Linear map{Eigen::MatrixXd::Constant(1, 1, -0.8), Vector::Ones(1)};
  Aitken aitken(0.3);
  EXPECT_LE(calls(aitken, map, Vector::Zero(1), 1e-12), 4);
}

TEST(ConstantRelaxation, ConvergesAtItsRate) {
  Linear map{Eigen::MatrixXd::Constant(1, 1, -0.5), Vector::Ones(1)};
  ConstantRelaxation relaxation(0.5);  // the residual is multiplied by 1 − ω (1 + 0.5) = 0.25
  EXPECT_EQ(calls(relaxation, map, Vector::Zero(1), std::pow(0.25, 10) * (1 + 1e-9)), 11);
}

}  // namespace
}  // namespace acopla::coupler
