#include "coupler/stability.h"

#include <gtest/gtest.h>

#include <cmath>

namespace acopla::coupler {
namespace {

// A node of 1 kg, windows of 1 s: the contact's frequency ω_c = √(k/M) is its turn in a window.
Touch touch(double turn, double damping_ratio, double particle) {
  const double stiffness = turn * turn, reduced = particle / (1 + particle);
  return {stiffness, 2 * damping_ratio * std::sqrt(stiffness * reduced), particle, 1};
}

TEST(ExplicitGrowth, IsThatOfTheFormulaInShortWindows) {
  // Δt⁴ k² / (48 M m), the first term of an expansion in ω_p Δt, ω_p² = k/m.
  for (const double particle : {0.1, 1.0, 10.0})
    for (const double turn : {0.02, 0.01}) {
      const double leading = std::pow(turn, 4) / (48 * particle);
      EXPECT_NEAR(growth_of_free_particle(touch(turn, 0, particle), 1) / leading, 1, 0.1 * turn * turn / particle + 1e-3) << particle << " " << turn;
    }
}

TEST(ExplicitGrowth, AgainstAFixedPartnerBeginsAtTheLimit) {
  const double heavy = 1e6;
  for (const double dashpot : {0.0, 0.2, 1.0})
    for (const double share : {0.5, 0.99, 1.01, 1.5}) {
      const double stiffness = 4 * share - 2 * dashpot;  // (k Δt² + 2 c Δt)/M = 4 · share
      if (stiffness < 0) continue;
      const double growth = explicit_growth({stiffness, dashpot, heavy, 1}, 1);
      if (share < 1) EXPECT_LT(growth, 1e-4) << dashpot << " " << share;
      else EXPECT_GT(growth, 1e-2) << dashpot << " " << share;
    }
}

TEST(ExplicitGrowth, ALightParticleInABedGivesWayWhereItIsDamped) {
  // Half the stiffness: the limit is √8 = 2.83 instead of 2, at any damping that lets a particle come to rest in some windows.
  for (const double ratio : {0.1, 0.33, 0.6}) {
    EXPECT_LT(growth_of_held_particle(touch(2.75, ratio, 1e-4), 1), 0) << ratio;
    EXPECT_GT(growth_of_held_particle(touch(2.95, ratio, 1e-4), 1), 0.1) << ratio;
  }
  // Undamped it is thrown about even in windows far shorter.
  EXPECT_GT(growth_of_held_particle(touch(0.25, 0, 1e-2), 1), 1e-3);
  EXPECT_LT(growth_of_held_particle(touch(0.25, 0.1, 1e-2), 1), 0);
}

TEST(ExplicitGrowth, OverdampedOrAlmostCriticalItIsAsSmooth) {
  // On either side of critical damping the formulas are others.
  for (const double particle : {1e-3, 1.0, 1e3}) {
    const double stiffness = 0.1, critical = 2 * std::sqrt(stiffness * particle);
    for (const double off : {1e-3, 1e-7, 1e-12}) {
      const double below = explicit_growth({stiffness, critical * (1 - off), particle, 1}, 1), above = explicit_growth({stiffness, critical * (1 + off), particle, 1}, 1);
      EXPECT_NEAR(below, above, 50 * off + 1e-9) << particle << " " << off;
    }
    for (const auto growth : {growth_of_free_particle, growth_of_held_particle}) {
      EXPECT_TRUE(std::isfinite(growth({stiffness, 1000 * critical, particle, 1}, 1)));
      EXPECT_TRUE(std::isfinite(growth({1e-300, critical, particle, 1}, 1)));
    }
  }
}

}  // namespace
}  // namespace acopla::coupler
