// What every contact law must do, whatever it is: the properties of each combination of laws, for discs and spheres.
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/unit/dem/all_models.h"
#include "tests/unit/dem/law_paths.h"

namespace acopla::dem::test {
namespace {

template <class Case_>
class LawProperties : public ::testing::Test {
 public:
  using Model = typename Case_::Model;
  static constexpr int dimension = Case_::dimension;
  using K = Kinematics<double, dimension>;
  using History = typename Model::template History<K>;
  using Response = typename Model::template Response<K>;
  using Path = ClosedPath<dimension>;
  static constexpr std::size_t numbers = Model::template history_size<K>();

  // Compiled once, so that the same numbers give the same answer whatever the compiler fuses.
  [[gnu::noinline]] static Response respond(const K& k, const typename Model::Parameters& p, History& history,
                                            ContactEnergy<double>* energy = nullptr) {
    auto r = Model::respond(k, p, history, energy);
    if (!Model::has_friction) r.shear = zero_vector<double, K::turns>();
    if (!Model::has_rolling) r.torque = zero_vector<double, K::turns>();
    return r;
  }
  static std::array<double, numbers> flat(const History& history) {
    std::array<double, numbers> values{};
    if constexpr (numbers > 0) {
      static_assert(sizeof(History) == sizeof(values));
      std::copy_n(reinterpret_cast<const double*>(&history), numbers, values.begin());
    }
    return values;
  }
  static void set(History& history, const std::array<double, numbers>& values) {
    if constexpr (numbers > 0) std::copy_n(values.begin(), numbers, reinterpret_cast<double*>(&history));
  }

  // The contact of j with i.
  static K swapped(K k) {
    k.normal = -k.normal;
    if (dimension == 3) k.slip = -k.slip;  // in the plane it is a number along the tangent, which turns round too
    k.relative_spin = -k.relative_spin;
    k.frame_spin = -k.frame_spin;
    return k;
  }
};
TYPED_TEST_SUITE(LawProperties, AllModels, CaseName);

TEST(PropertyTests, CoverEveryBuiltInLaw) {
  std::vector<LawSet> covered;
  [&]<class... Cases>(::testing::Types<Cases...>*) { (covered.push_back(names_of<typename Cases::Model>()), ...); }(static_cast<AllModels*>(nullptr));
  for (const auto& laws : Laws::built_in().combinations()) EXPECT_TRUE(std::find(covered.begin(), covered.end(), laws) != covered.end()) << laws.text();
}

TYPED_TEST(LawProperties, AreTheSameWhicheverBodyIsCalledTheFirst) {
  // Only signs change, which rounding does not see.
  using T = LawProperties<TypeParam>;
  const auto p = T::Model::from(soft_glass());
  const auto signs = T::Model::template swap_signs<typename T::K>();
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const typename T::Path path(seed);
    typename T::History a{}, b{};
    const double step = T::Path::period / 200;
    for (int n = 0; n < 200; ++n) {
      auto k = path.at(n * step, step);
      k.frame_spin = T::dimension == 3 ? 30 : 0;
      auto renamed = T::flat(a);
      for (std::size_t m = 0; m < T::numbers; ++m) renamed[m] *= signs[m];
      T::set(b, renamed);
      const auto on_i = T::respond(k, p, a), on_j = T::respond(T::swapped(k), p, b);
      ASSERT_EQ(on_i.normal, on_j.normal);
      ASSERT_EQ((eigen(on_i.shear) + (T::dimension == 3 ? 1 : -1) * eigen(on_j.shear)).norm(), 0);
      ASSERT_EQ((eigen(on_i.torque) + eigen(on_j.torque)).norm(), 0);
      auto kept = T::flat(b);
      for (std::size_t m = 0; m < T::numbers; ++m) ASSERT_EQ(kept[m] * signs[m], T::flat(a)[m]);
    }
  }
}

TYPED_TEST(LawProperties, DoNotDependOnTheObserversDirections) {
  // The whole motion in a turned frame; round-off of the rotation, which friction and yield carry along without growth.
  using T = LawProperties<TypeParam>;
  const auto p = T::Model::from(soft_glass());
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const typename T::Path path(seed);
    const Eigen::AngleAxisd turn(0.3 + seed, T::dimension == 3 ? Vec3(1, 2, seed).normalized() : Vec3::UnitZ());
    const auto turned = [&](const auto& v) { return vector_of<3>(turn * eigen(v)); };
    typename T::History here{}, there{};
    const double step = T::Path::period / 200;
    double force = 0, torque = 0;
    for (int n = 0; n < 200; ++n) {
      auto k = path.at(n * step, step);
      k.frame_spin = T::dimension == 3 ? 30 : 0;
      auto k_turned = k;
      k_turned.normal = vector_of<T::dimension>(turn * eigen(k.normal));
      if constexpr (T::dimension == 3) {
        k_turned.slip = turned(k.slip);
        k_turned.relative_spin = turned(k.relative_spin);
      }
      const auto r = T::respond(k, p, here), s = T::respond(k_turned, p, there);
      force = std::max(force, r.normal);
      torque = std::max(torque, eigen(r.torque).norm());
      ASSERT_NEAR(r.normal, s.normal, 1e-14 * force);
      if constexpr (T::dimension == 3) {
        ASSERT_LE((turn * eigen(r.shear) - eigen(s.shear)).norm(), 1e-13 * force);
        ASSERT_LE((turn * eigen(r.torque) - eigen(s.torque)).norm(), 1e-13 * torque);
      } else {
        ASSERT_EQ(r.shear.x, s.shear.x);
        ASSERT_EQ(r.torque.x, s.torque.x);
      }
    }
  }
}

// The account of one contact: work taken from the bodies by the trapezoidal rule, less what the springs store.
template <class T>
struct Loss {
  double normal = 0, tangential = 0, rolling = 0;  // work taken from the bodies [J]
  double total = 0, largest = 0;                   // lost so far; the most that was ever stored
  double peak = 0, rise = 0;                       // how far the loss ever stood below an earlier value
  ContactEnergy<double> told;                      // what the ledger was told of it, in sum
  double first_stored = 0, dashpot = 0;
  void add(const typename T::K& k, const typename T::Response& r, const ContactEnergy<double>& energy) {
    const double now = energy.normal + energy.tangential + energy.rolling;
    largest = std::max(largest, now);
    if (started_) {
      const double half = 0.5 * k.step;
      normal += half * (last_.normal * last_speed_ + r.normal * k.closing_speed);
      tangential -= half * dot(last_.shear + r.shear, k.slip);
      rolling -= half * dot(last_.torque + r.torque, k.relative_spin);
      dashpot += half * (last_told_.normal_dashpot + energy.normal_dashpot);
      told.add(energy);
      total = normal + tangential + rolling - (now - first_stored);
      peak = std::max(peak, total);
      rise = std::max(rise, peak - total);
    } else {
      first_stored = now;
    }
    last_ = r;
    last_speed_ = k.closing_speed;
    last_told_ = energy;
    started_ = true;
  }
  double normal_stored() const { return last_told_.normal; }

 private:
  typename T::Response last_;
  ContactEnergy<double> last_told_;
  double last_speed_ = 0;
  bool started_ = false;
};

TYPED_TEST(LawProperties, NeverGiveEnergy) {
  // On random closed paths of overlap, slip and relative rotation, twice round, what the contact has taken from the bodies beyond
  // what its springs hold only grows. The trapezoidal rule of the work leaves an error of order (2π/N)² of the energy that goes to and
  // fro, here up to 1.7 times that.
  using T = LawProperties<TypeParam>;
  for (const auto& pair : {soft_glass(), elastic_glass()}) {
    const auto p = T::Model::from(pair);
    for (unsigned seed = 1; seed <= 20; ++seed) {
      const typename T::Path path(seed);
      constexpr int steps = 4000;
      const double step = T::Path::period / steps;
      typename T::History history{};
      Loss<T> loss;
      for (int n = 0; n <= 2 * steps; ++n) {
        ContactEnergy<double> energy;
        const auto k = path.at(n * step, step);
        const auto r = T::respond(k, p, history, &energy);
        loss.add(k, r, energy);
      }
      EXPECT_LE(loss.rise, 2 * std::pow(2 * M_PI / steps, 2) * loss.largest) << seed << " of " << loss.largest;
    }
  }
}

TYPED_TEST(LawProperties, TheLedgersNumbersAreTheWorkOfTheForces) {
  // What the ledger is told must be what forces and motion say: the loss in the normal direction is its work less the change of its
  // stored energy; the others are works. Over a whole period the trapezoidal rule of the normal direction is exact to round-off where
  // the loss is smooth; a law that yields starts to lose from one step to the next, which leaves a share of that step. The tangential
  // and rolling dashpots are told at the half step, and sliding switches them, which leaves a share of some steps.
  using T = LawProperties<TypeParam>;
  const auto p = T::Model::from(soft_glass());
  constexpr bool yields = !std::is_empty_v<typename T::Model::Normal::template History<typename T::K>>;
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const typename T::Path path(seed);
    for (const int steps : {4000, 16000}) {
      const double step = T::Path::period / steps, share = 2 * M_PI / steps;
      typename T::History history{};
      Loss<T> loss;
      double first = 0;
      for (int n = 0; n <= steps; ++n) {
        ContactEnergy<double> energy;
        const auto k = path.at(n * step, step);
        loss.add(k, T::respond(k, p, history, &energy), energy);
        if (n == 0) first = energy.normal;
      }

      EXPECT_NEAR(loss.normal - loss.dashpot, loss.normal_stored() - first, (yields ? share : 1e-12) * loss.largest) << seed;
      EXPECT_NEAR(loss.tangential, loss.told.tangential_work, 0.4 * share * loss.largest) << seed;
      EXPECT_NEAR(loss.rolling, loss.told.rolling_work, 0.04 * share * loss.largest) << seed;
    }
  }
}

TYPED_TEST(LawProperties, ReturnWhatTheSpringsStored) {
  // Without dashpots and within all limits the way back gives what the way there took. Tangential and rolling springs at constant
  // overlap, the normal one without slip, so that Mindlin's loss on unloading stays out. The trapezoidal rule of a smooth power over a
  // whole period leaves round-off.
  using T = LawProperties<TypeParam>;
  auto pair = elastic_glass();
  if (std::is_same_v<typename T::Model::Rolling, ConstantTorque>) pair.rolling_friction = 0;  // it has no spring
  const auto p = T::Model::from(pair);
  for (const bool along : {true, false})
    for (unsigned seed = 1; seed <= 5; ++seed) {
      typename T::Path path(seed);
      (along ? path.sliding : path.breathing) = 0;
      if (along) path.rolling = 0;
      constexpr int steps = 4000;
      const double step = T::Path::period / steps;
      typename T::History history{};
      Loss<T> loss;
      for (int n = 0; n <= steps; ++n) {
        ContactEnergy<double> energy;
        const auto k = path.at(n * step, step);
        const auto r = T::respond(k, p, history, &energy);
        loss.add(k, r, energy);
      }
      EXPECT_NEAR(loss.total, 0, 1e-12 * loss.largest);
      if (along || T::Model::has_friction) { EXPECT_GT(loss.largest, 1e-9); }  // ½ 1e3 N/m (1e-6 m)²
    }
}

TYPED_TEST(LawProperties, SpringsAreOfSecondOrderInTheStep) {
  // Force and torque after a third of a path, while the overlap grows or falls, sticking; the path is entered without slip and spin.
  // Halving the step divides the error by 4; 32 times finer steps stand for the exact answer, which moves the ratio by less than 1 %.
  // Springs of constant stiffness are exact in their increments, up to round-off.
  using T = LawProperties<TypeParam>;
  if constexpr (T::Model::has_friction) {
    const auto p = T::Model::from(elastic_glass());
    for (unsigned seed = 1; seed <= 6; ++seed) {
      typename T::Path path(seed);
      path.entry = T::Path::period / 3;
      const auto after = [&](int steps) {
        const double step = T::Path::period / 3 / steps;
        typename T::History history{};
        typename T::Response r{};
        for (int n = 1; n <= steps; ++n) {
          auto k = path.at(n * step, step);
          k.overlap = path.overlap * (1 + (seed % 2 ? 0.6 : -0.6) * std::pow(double(n) / steps, 2));
          r = T::respond(k, p, history);
        }
        return r;
      };
      const auto exact = after(256 * 60), coarse = after(8 * 60), fine = after(16 * 60);
      const auto expect_second_order = [&](const char* what, const Vec3& at_exact, const Vec3& at_coarse, const Vec3& at_fine) {
        const double error = (at_coarse - at_exact).norm();
        if (error > 1e-10 * at_exact.norm()) {
          EXPECT_NEAR(error / (at_fine - at_exact).norm(), 4, 0.1) << what << " of path " << seed;
        }
      };
      expect_second_order("force", eigen(exact.shear), eigen(coarse.shear), eigen(fine.shear));
      if (std::is_same_v<typename T::Model::Rolling, ElasticPlastic>)
        expect_second_order("torque", eigen(exact.torque), eigen(coarse.torque), eigen(fine.torque));
    }
  }
}

TYPED_TEST(LawProperties, AFrameThatTurnsCarriesTheSpringsAlong) {
  // The same motion, seen from a frame that turns by two radians about an oblique axis: response and history turn with it. Springs are
  // carried by first-order rotations whose direction, not length, is off by up to a quarter of the square of the tilt in each step:
  // had a spring been kept all along, by 2²/(4 N); friction and way back make it a seventh of that here. Half of that with half the step.
  using T = LawProperties<TypeParam>;
  if constexpr (T::dimension == 3) {
    const auto p = T::Model::from(soft_glass());
    for (unsigned seed = 1; seed <= 3; ++seed) {
      const typename T::Path path(seed);
      const Vec3 axis = Vec3(1, -2, seed).normalized();
      const double angle = 2;
      const auto worst = [&](int steps) {
        const double step = T::Path::period / steps;
        typename T::History still{}, turning{};
        double force = 0, torque = 0, shear_error = 0, torque_error = 0;
        for (int n = 1; n <= steps; ++n) {
          const auto k = path.at(n * step, step);
          const Eigen::AngleAxisd turn(angle * n / steps, axis);
          auto seen = k;
          seen.normal = vector_of<3>(turn * eigen(k.normal));
          seen.slip = vector_of<3>(turn * eigen(k.slip));
          seen.relative_spin = vector_of<3>(turn * eigen(k.relative_spin));
          seen.frame_spin = axis.dot(eigen(seen.normal)) * angle / T::Path::period;
          const auto r = T::respond(k, p, still), s = T::respond(seen, p, turning);
          EXPECT_NEAR(r.normal, s.normal, 1e-14 * r.normal);
          force = std::max(force, eigen(r.shear).norm());
          torque = std::max(torque, eigen(r.torque).norm());
          shear_error = std::max(shear_error, (turn * eigen(r.shear) - eigen(s.shear)).norm());
          torque_error = std::max(torque_error, (turn * eigen(r.torque) - eigen(s.torque)).norm());
        }
        return std::max(force > 0 ? shear_error / force : 0, torque > 0 ? torque_error / torque : 0);
      };
      EXPECT_LE(worst(4000), 0.15 / 4000) << seed;
      EXPECT_LE(worst(8000), 0.15 / 8000) << seed;
    }
  }
}

TYPED_TEST(LawProperties, AreFiniteAndSilentWithoutOverlap) {
  // Lanes that do not touch are computed too, with whatever motion the bodies have.
  using T = LawProperties<TypeParam>;
  const auto p = T::Model::from(soft_glass());
  std::vector<typename T::K> contacts;
  for (unsigned seed = 1; seed <= 5; ++seed) contacts.push_back(typename T::Path(seed).at(seed * 1e-3, 1e-5));
  for (const int still : {1, 2, 3}) {  // nothing slips; nothing spins; neither
    auto k = contacts.front();
    if (still & 1) k.slip = zero_vector<double, T::K::turns>();
    if (still & 2) k.relative_spin = zero_vector<double, T::K::turns>();
    contacts.push_back(k);
  }
  for (auto k : contacts) {
    k.overlap = 0;
    std::array<double, T::numbers> forces{};
    forces.fill(1e-3);
    for (const bool was_touching : {false, true}) {
      typename T::History history{};
      if (was_touching) T::set(history, forces);
      ContactEnergy<double> energy;
      const auto r = T::respond(k, p, history, &energy);
      EXPECT_EQ(r.normal, 0);
      EXPECT_EQ(eigen(r.shear).norm(), 0);
      EXPECT_EQ(eigen(r.torque).norm(), 0);
      for (const double value : T::flat(history)) EXPECT_TRUE(std::isfinite(value));
      for (const double value : {energy.normal, energy.tangential, energy.rolling, energy.normal_dashpot, energy.tangential_work, energy.rolling_work})
        EXPECT_TRUE(std::isfinite(value));
    }
  }
}

TYPED_TEST(LawProperties, LanesAreContacts) {
  // A pack of paths at once and one by one: one slides more than the others, one starts without overlap, one stands still. The
  // operations are the same up to fused multiply-adds, and neither friction nor yield makes round-off grow.
  using T = LawProperties<TypeParam>;
  using Pack = Kinematics<DoublePack, T::dimension>;
  const auto p = T::Model::from(soft_glass());
  std::vector<typename T::Path> paths;
  for (unsigned lane = 0; lane < lanes; ++lane) paths.emplace_back(lane + 1);
  paths[1].sliding *= 10;
  paths[3].sliding = paths[3].rolling = paths[3].breathing = 0;
  const double step = T::Path::period / 300;
  typename T::History one[lanes] = {};
  typename T::Model::template History<Pack> packed;
  if constexpr (T::numbers > 0) std::fill_n(reinterpret_cast<double*>(&packed), lanes * T::numbers, 0.0);
  double force = 0, torque = 0;
  for (int n = 0; n < 300; ++n) {
    Pack pack;
    typename T::Response alone[lanes];
    ContactEnergy<double> energies[lanes];
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      auto k = paths[lane].at(n * step, step);
      if (lane == 2 && n < 20) k.overlap = 0;
      k.frame_spin = T::dimension == 3 ? 30 - 10 * static_cast<double>(lane) : 0;
      // Every member of Kinematics but the step is a row of doubles.
      constexpr std::size_t rows = sizeof(typename T::K) / sizeof(double) - 1;
      static_assert(sizeof(Pack) >= (rows * lanes + 1) * sizeof(double));
      for (std::size_t row = 0; row < rows; ++row) reinterpret_cast<double*>(&pack)[lanes * row + lane] = reinterpret_cast<const double*>(&k)[row];
      alone[lane] = T::respond(k, p, one[lane], &energies[lane]);
      force = std::max(force, alone[lane].normal);
      torque = std::max(torque, eigen(alone[lane].torque).norm());
    }
    pack.step = step;
    ContactEnergy<DoublePack> energy;
    const auto together = T::Model::respond(pack, p, packed, &energy);
    const auto lane_of = [](const auto& v, std::size_t lane) {
      if constexpr (T::K::turns == 1) return Vec3(v.x[lane], 0, 0);
      else return Vec3(v.x[lane], v.y[lane], v.z[lane]);
    };
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      ASSERT_NEAR(together.normal[lane], alone[lane].normal, 1e-14 * force);
      if constexpr (T::Model::has_friction) { ASSERT_LE((lane_of(together.shear, lane) - eigen(alone[lane].shear)).norm(), 1e-13 * force); }
      if constexpr (T::Model::has_rolling) { ASSERT_LE((lane_of(together.torque, lane) - eigen(alone[lane].torque)).norm(), 1e-13 * torque); }
      ASSERT_NEAR(energy.normal[lane], energies[lane].normal, 1e-13 * force * 1e-4);
      ASSERT_NEAR(energy.tangential[lane], energies[lane].tangential, 1e-13 * force * 1e-4);
      ASSERT_NEAR(energy.rolling[lane], energies[lane].rolling, 1e-13 * force * 1e-4);
    }
  }
}

}  // namespace
}  // namespace acopla::dem::test
