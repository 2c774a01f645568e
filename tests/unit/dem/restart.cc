// A run that was saved and continued is the run that was not: bit for bit.
#include <gtest/gtest.h>

#include "dem/feeding/random.h"
#include "io/archive.h"
#include "scenes.h"

namespace acopla::dem::test {
namespace {

// A heap that slides, rolls and collides on a mesh floor and against a plane that moves.
std::unique_ptr<Engine> heap(const Laws& laws, unsigned partitions, unsigned threads, bool ledger = false) {
  auto scene = scene_of(laws);
  scene.gravity = Vec3(1.0, 0.4, -9.81);
  scene.partitions = partitions;
  scene.threads = threads;
  scene.keeps_ledger = ledger;
  scene.drift_limit = 1;
  Random random(11);
  std::vector<Ball> balls;
  for (int k = 0; k < 300; ++k)
    balls.push_back({2.1 * radius * Vec3(k % 8 - 4, k / 8 % 8 - 4, k / 64 + 0.6) + 0.03 * radius * Vec3(random.uniform(), random.uniform(), 0),
                     Vec3(random.uniform() - 0.5, random.uniform() - 0.5, -0.5)});
  auto side = plane(Vec3(0.12, 0, 0), -Vec3::UnitX());
  side.motion = Motion::vibration(Vec3(0.01, 0, 0), 20, 0.3);
  return engine_with(scene, balls, {triangulated_floor(0.4, 9), side});
}

std::vector<Laws> all_laws() {
  return {hertz_mindlin, linear_slider, with_rolling(hertz_mindlin, 0.1), with_elastic_plastic(hertz_mindlin, 0.1), with_elastic_plastic(linear_slider, 0.1)};
}

void expect_same(const Engine& a, const Engine& b) {
  const auto &p = a.particles(), &q = b.particles();
  ASSERT_EQ(p.id, q.id);
  for (std::size_t i = 0; i < p.size(); ++i) {
    ASSERT_EQ(p.position[i].vector(), q.position[i].vector()) << i;
    ASSERT_EQ(p.velocity[i].vector(), q.velocity[i].vector()) << i;
    ASSERT_EQ(p.spin_of(i), q.spin_of(i)) << i;
  }
}

TEST(Restart, ContinuesBitByBitBetweenRebuildsWithSlidingContacts) {
  for (const auto& laws : all_laws()) {
    const double step = 0.2 * critical_step(scene_of(laws)).seconds;
    const auto whole = heap(laws, 3, 1, true);
    whole->advance(137, step);  // in the middle of a list's life
    io::State state;
    io::save(*whole, state);
    const auto rebuilds = whole->rebuilds();
    const auto continued = heap(laws, 3, 1, true);
    io::restore(state, *continued);
    for (int window = 0; window < 20; ++window) {
      whole->advance(50, step);
      continued->advance(50, step);
      ASSERT_EQ(whole->wall_load().walls[0].force, continued->wall_load().walls[0].force);
    }
    expect_same(*whole, *continued);
    EXPECT_EQ(whole->energy().drift, continued->energy().drift);
    EXPECT_EQ(whole->rebuilds(), continued->rebuilds());
    EXPECT_GT(whole->rebuilds(), rebuilds);
    EXPECT_GT(whole->contact_count(), 100u);
  }
}

TEST(Restart, RollingBackAWindowUndoesIt) {
  const double step = 0.2 * critical_step(scene_of(hertz_mindlin)).seconds;
  const auto engine = heap(hertz_mindlin, 2, 1);
  engine->advance(100, step);
  io::State state;
  io::save(*engine, state);
  engine->advance(300, step);
  const auto reference = heap(hertz_mindlin, 2, 1);
  reference->advance(100, step);
  io::restore(state, *engine);
  engine->advance(300, step);
  reference->advance(300, step);
  expect_same(*engine, *reference);
}

TEST(Threads, ResultsDependOnPartitionsAndNotOnThreads) {
  for (const auto& laws : {hertz_mindlin, with_elastic_plastic(linear_slider, 0.1)}) {
    const double step = 0.2 * critical_step(scene_of(laws)).seconds;
    const auto one = heap(laws, 5, 1), two = heap(laws, 5, 2), four = heap(laws, 5, 4);
    for (const auto* engine : {one.get(), two.get(), four.get()}) const_cast<Engine*>(engine)->advance(1500, step);
    expect_same(*one, *two);
    expect_same(*one, *four);
  }
}

TEST(Threads, PartitionsAgreeWithOneWhileRoundOffHasNotGrown) {
  // Sums in another order: after few steps the trajectories differ by round-off alone.
  const double step = 0.2 * critical_step(scene_of(hertz_mindlin)).seconds;
  const auto one = heap(hertz_mindlin, 1, 1), seven = heap(hertz_mindlin, 7, 2);
  one->advance(200, step);
  seven->advance(200, step);
  for (std::uint32_t id = 0; id < 300; ++id) ASSERT_LT((position(*one, id) - position(*seven, id)).norm(), 1e-13);
}

}  // namespace
}  // namespace acopla::dem::test
