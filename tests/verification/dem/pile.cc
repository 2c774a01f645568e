// Gomes (2014) §3.3.1: 25 discs put down in a heap stay one while they resist rolling. Statistics of an independent code (reference.py,
// free_pile_statistics) over jitters of the start; single trajectories are chaotic.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "dem/contact/restitution.h"
#include "dem/step.h"
#include "setup.h"

namespace acopla::dem::verification {
namespace {

struct Heap {
  double kinetic, highest, width;  // heights and widths of centres over r
  int off_floor;
};

Heap release(double rolling_friction, unsigned seed) {
  const auto& p = reference()["piles"]["parameters"]["free_pile"];
  const auto& values = reference()["piles"]["values"];
  const double r = p["radius"], m = values["free_pile"]["mass"];
  OneMaterial setup;
  setup.dimension = 2;
  setup.gravity = Vec3(0, -standard_gravity, 0);
  setup.radius = r;
  setup.density = p["density"];
  const double normal = p["normal_stiffness"], shear = p["tangential_stiffness"], c_n = p["normal_damping"], c_t = p["tangential_damping"];
  // The paper's dashpots between two discs; those on the floor, of twice the reduced mass, come out √2 stronger.
  setup.normal = linear(normal);
  setup.restitution = restitution_without_tension(linear_impact, c_n / std::sqrt(normal * m / 2));
  setup.tangential = linear_slider(normal / shear, c_t / (2 * std::sqrt(shear * m / 2)));
  setup.rolling = elastic_plastic(p["eta_r"]);
  setup.friction = p["friction"];
  setup.rolling_friction = rolling_friction;
  setup.more = "damping = { viscous = { translation = 1e-4, rotation = 1e-5 } }";
  const auto scene = scene_of(setup);
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> jitter(-0.01 * r, 0.01 * r);
  std::vector<Body> discs;
  for (const auto& at : values["free_pile_positions_without_jitter"]) {
    const double x = at[0].get<double>() + jitter(random), y = at[1].get<double>() + jitter(random);
    discs.push_back({Vec3(x, y, 0), r});
  }
  const auto engine = engine_of(scene, discs, {plane(Vec3::Zero(), Vec3::UnitY())});
  const double step = 0.2 * critical_step(scene).seconds;
  engine->advance(static_cast<std::uint64_t>(3.0 / step), step);
  Heap heap{engine->kinetic_energy(), 0, 0, 0};
  double left = INFINITY, right = -INFINITY;
  for (const auto& x : engine->particles().position) {
    heap.highest = std::max(heap.highest, x.y / r);
    heap.off_floor += x.y > 1.5 * r;
    left = std::min(left, x.x / r);
    right = std::max(right, x.x / r);
  }
  heap.width = right - left;
  return heap;
}

TEST(FreePile, StaysAHeapWhileDiscsResistRolling) {
  const auto& seen = reference()["free_pile_statistics"]["values"]["mu_r_0.2"];
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const auto heap = release(0.2, seed);
    // The reference code's eight starts agree to 0.03 r in height and to 3.3 r in width, all with 15 discs off the floor.
    EXPECT_LT(heap.kinetic, 1e-20) << "at rest after 3 s, to round-off";
    EXPECT_EQ(heap.off_floor, 15) << seed;
    EXPECT_NEAR(heap.highest, seen["highest_centre_over_r"]["mean"].get<double>(), 0.05) << seed;
    EXPECT_NEAR(heap.width, seen["width_over_r"]["mean"].get<double>(), 3.5) << seed;
  }
}

TEST(FreePile, SpreadsWithoutRollingResistance) {
  // Single discs roll for good, so widths differ by a quarter between starts.
  const auto& seen = reference()["free_pile_statistics"]["values"]["mu_r_0"];
  for (unsigned seed = 1; seed <= 3; ++seed) {
    const auto heap = release(0, seed);
    EXPECT_NEAR(heap.width, seen["width_over_r"]["mean"].get<double>(), 0.3 * seen["width_over_r"]["mean"].get<double>()) << seed;
    EXPECT_LE(heap.off_floor, seen["discs_off_the_floor"]["most"].get<int>() + 1) << seed;
  }
}

}  // namespace
}  // namespace acopla::dem::verification
