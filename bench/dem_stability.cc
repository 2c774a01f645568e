// What steps the particles' solver stands, and what it says where it does not. One JSON object a line.
//   dem_stability limits [--quick]    first unstable step of a ball on a floor and of a squeezed bed, by bisection, for every law
//   dem_stability scan [--quick]      a shaken bed at 0.05 to 2.5 of the critical step, for every law: energy error, and what was said
//   dem_stability extremes [--quick]  stiffness, masses, sizes, speeds, friction, restitution, a tower, overlapped starts
//   dem_stability rest [--quick]      1e6 steps at rest
//
// A run is made three times: `unguarded` (ledger kept, nothing refused) to learn what really happens, `ledger` as a user with the ledger
// runs it, and `plain` as a user without. The latter two go by StepWatch, as the solver does, with windows of two hundred
// steps. A run breaks where the steps make more than a twentieth of the energy that the scene ever held.
#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <cstring>
#include <map>
#include <nlohmann/json.hpp>
#include <random>

#include "dem/step_watch.h"
#include "stability_scenes.h"

using namespace acopla::bench;
using namespace acopla;
using Json = nlohmann::json;

namespace {

bool quick = false;

void print(const Json& row) {
  fmt::print("{}\n", row.dump());
  std::fflush(stdout);
}

double mass_of(const Setting& s, std::size_t species = 0) {
  return s.species[species].density * dem::volume_of(s.dimension, s.species[species].radius);
}

// A time of the elastic contacts, whatever the dashpots: sqrt(m/k), or the Rayleigh time.
double period_of(const Setting& s) {
  const auto& one = s.species[0];
  if (s.laws.normal == "linear") return std::sqrt(mass_of(s) / s.stiffness);
  return M_PI * one.radius * std::sqrt(one.density / one.shear_modulus) / (0.1631 * 0.25 + 0.8766);
}

// --- one run ----------------------------------------------------------------------------------------------------------------

enum class Guard { none, ledger, plain };

struct Outcome {
  double drift = 0;    // largest |drift| of the ledger, relative; signed like the largest
  double gain = 0;     // largest energy beyond what was there and what walls did, as if nothing were ever lost; relative
  double ratio = 0;    // largest step_ratio seen
  double overlap = 0;  // deepest, over the smaller radius, at the end of a window
  std::string said;    // what stopped it
  bool finite = true;
};

Outcome run(Setting s, const std::vector<Body>& bodies, const std::vector<dem::Wall>& walls, double reach, double step, std::uint64_t steps,
            Guard guard) {
  s.ledger = guard != Guard::plain;
  s.allow_unstable = guard == Guard::none;
  Outcome outcome;
  auto scene = scene_of(s, reach);
  s.ledger = scene.keeps_ledger = s.ledger || dem::watches_energy(scene, step);
  const auto engine = engine_of(scene, bodies, walls);
  constexpr std::uint64_t window = 200;
  double start = 0, scale = 0;
  dem::StepWatch watch(scene);
  try {
    if (s.ledger) {
      engine->advance(0, step);
      start = engine->energy().stored();
    }
    for (std::uint64_t done = 0; done < steps;) {
      const auto some = std::min(window, steps - done);
      engine->advance(some, step);
      done += some;
      outcome.overlap = std::max(outcome.overlap, engine->worst_overlap());
      watch.look(*engine, step, done);
      outcome.ratio = std::max(outcome.ratio, watch.ratio());
      if (!s.ledger) continue;
      const auto e = engine->energy();
      if (!std::isfinite(e.stored())) {
        outcome.finite = false;
        break;
      }
      scale = std::max({scale, e.kinetic + e.normal + e.tangential + e.rolling, std::abs(e.wall_work)});
      if (e.relative_drift > std::abs(outcome.drift)) outcome.drift = std::copysign(e.relative_drift, e.drift);
      if (scale > 0) outcome.gain = std::max(outcome.gain, (e.stored() - start - e.wall_work) / scale);
    }
  } catch (const std::runtime_error& error) {
    outcome.said = error.what();
  }
  return outcome;
}

// What was said, in a word.
std::string kind_of(const std::string& said) {
  if (said.empty()) return "";
  for (const auto& [part, word] : {std::pair{"is unstable", "step ratio"}, {"energy drifts", "energy"}, {"in one step", "travel"}, {"left the domain", "domain"},
                                   {"pushed through", "wall"}, {"coincide", "coincident"}, {"begin with", "overlap"}})
    if (said.find(part) != std::string::npos) return word;
  return "other";
}

// The three runs of a case, as fields of a row.
Json runs(const Setting& s, const std::vector<Body>& bodies, const std::vector<dem::Wall>& walls, double reach, double step, std::uint64_t steps) {
  const auto truth = run(s, bodies, walls, reach, step, steps, Guard::none);
  const bool broke = !truth.said.empty() || !truth.finite || truth.drift > 0.05 || truth.gain > 0.05;
  const auto ledger = run(s, bodies, walls, reach, step, steps, Guard::ledger), plain = run(s, bodies, walls, reach, step, steps, Guard::plain);
  return {{"step", step}, {"steps", steps}, {"drift", truth.finite ? truth.drift : 1e300}, {"gain", truth.finite ? truth.gain : 1e300},
          {"ratio", truth.ratio}, {"overlap", truth.overlap}, {"broke", broke}, {"stopped", kind_of(truth.said)}, {"ledger", kind_of(ledger.said)},
          {"plain", kind_of(plain.said)}, {"said", ledger.said.empty() ? plain.said : ledger.said},
          {"silent", broke && (ledger.said.empty() || plain.said.empty())}};
}

Json about(const char* scene, const Setting& s) {
  return {{"scene", scene}, {"dimension", s.dimension}, {"laws", s.laws.text()}, {"restitution", s.restitution}, {"friction", s.friction}};
}

// --- the limits -------------------------------------------------------------------------------------------------------------

// A small disturbance of bodies at rest grows a hundredfold or it does not.
bool grows(const Setting& s, const std::vector<Body>& at_rest, const std::vector<dem::Wall>& walls, double reach, double speed, double step) {
  auto bodies = at_rest;
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> even(-1, 1);
  const bool plane = s.dimension == 2;
  for (auto& b : bodies) {
    b.velocity = speed * Vec3(even(random), even(random), plane ? 0 : even(random));
    b.spin = speed / b.radius * (plane ? Vec3(0, 0, even(random)) : Vec3(even(random), even(random), even(random)));
  }
  const auto engine = engine_of(scene_of(s, reach), bodies, walls);
  const double start = engine->kinetic_energy();
  try {
    for (int chunk = 0; chunk < 60; ++chunk) {
      engine->advance(100, step);
      const double now = engine->kinetic_energy() / start;
      if (!(now < 1e4)) return true;
      if (now < 1e-6) return false;
    }
  } catch (const std::runtime_error&) {
    return true;
  }
  return false;
}

void limit(const char* name, Setting s, const std::vector<Body>& at_rest, const std::vector<dem::Wall>& walls, double reach, double overlap) {
  s.more += "step_fraction = 1.0\n";
  s.allow_unstable = true;
  const auto critical = dem::critical_step(scene_of(s, reach));
  const double speed = 1e-8 * overlap * s.species[0].radius / period_of(s);
  const auto unstable = [&](double fraction) { return grows(s, at_rest, walls, reach, speed, fraction * critical.seconds); };
  double high = 0.05;
  while (high < 50 && !unstable(high)) high *= 1.25;
  double low = high / 1.25;
  while (high / low > 1 + 5e-4) {
    const double middle = std::sqrt(low * high);
    (unstable(middle) ? high : low) = middle;
  }
  const auto engine = engine_of(scene_of(s, reach), at_rest, walls);
  engine->advance(0, high * critical.seconds);
  auto row = about(name, s);
  row.update({{"part", "limits"}, {"critical", critical.seconds}, {"first_unstable", high}, {"ratio", engine->step_ratio(high * critical.seconds).value},
              {"overlap", overlap}, {"particles", at_rest.size()}});
  print(row);
}

// Overlap of a ball on a floor under its weight, over the radius; gravity that gives it.
double gravity_for(const Setting& s, double overlap) {
  const double r = s.species[0].radius, depth = overlap * r;
  if (s.laws.normal == "linear") return s.stiffness * depth / mass_of(s);
  const auto scene = scene_of(s, 1);
  return 4.0 / 3 * scene.pair(0, 0).modulus * std::sqrt(r * depth) * depth / mass_of(s);
}

void limits() {
  std::map<std::pair<int, std::string>, Bed> beds;
  for (const int dimension : {2, 3})
    for (const double restitution : quick ? std::vector{0.5} : std::vector{1.0, 0.5, 0.01})
      for (const auto& laws : all_laws()) {
        Setting s;
        s.dimension = dimension;
        s.laws = laws;
        s.restitution = restitution;
        s.stiffness = mass_of(s) / 1e-6;
        const double overlap = 0.01, r = s.species[0].radius;
        auto ball = s;
        ball.gravity = gravity_for(s, overlap);
        limit("ball on a floor", ball, {{dimension == 2 ? Vec3(0, r * (1 - overlap), 0) : Vec3(0, 0, r * (1 - overlap))}}, box(dimension, 1, true), 10 * r,
              overlap);
        const int edge = dimension == 2 ? (quick ? 5 : 7) : (quick ? 3 : 4);
        auto& bed = beds[{dimension, laws.normal}];
        if (bed.bodies.empty()) bed = squeezed_bed(s, edge, 0.01, 11);
        if (!bed.at_rest) throw std::runtime_error("the squeezed bed does not come to rest");
        limit("squeezed bed", s, bed.bodies, box(dimension, bed.side), bed.side, bed.mean_overlap);
      }
}

// --- step against critical step ---------------------------------------------------------------------------------------------

// Balls on a loose lattice in a box, whose floor shakes and whose side pushes in.
struct Shaken {
  std::vector<Body> bodies;
  std::vector<dem::Wall> walls;
  double side = 0, time = 0;
};
Shaken shaken(Setting& s, int edge) {
  const double period = period_of(s);
  Shaken scene;
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> even(-1, 1);
  const bool plane = s.dimension == 2;
  const double r = s.species[0].radius, pitch = 2.3 * r;
  scene.side = pitch * edge;
  for (int k = 0; k < (plane ? 1 : edge); ++k)
    for (int j = 0; j < edge; ++j)
      for (int i = 0; i < edge; ++i) {
        Body b;
        b.radius = r;
        b.at = pitch * Vec3(i + 0.5, j + 0.5, plane ? 0 : k + 0.5);
        b.velocity = r / period * 0.005 * Vec3(even(random), even(random), plane ? 0 : even(random));
        scene.bodies.push_back(b);
      }
  scene.walls = box(s.dimension, scene.side);
  scene.walls[0].motion = dem::Motion::vibration(0.3 * r * Vec3::Unit(s.dimension - 1), 1 / (60 * period), 0);
  scene.time = (quick ? 200 : 600) * period;
  scene.walls[2].motion = dem::Motion::translation(0.05 * scene.side / scene.time * Vec3::UnitX());
  s.gravity = 5e-4 * r / (period * period);
  return scene;
}

Json scan_row(Setting s, int edge, double fraction) {
  const double critical = dem::critical_step(scene_of(s, 1)).seconds;
  const auto scene = shaken(s, edge);
  const double step = fraction * critical;
  auto row = about("shaken bed", s);
  row["fraction"] = fraction;
  row.update(runs(s, scene.bodies, scene.walls, scene.side, step, static_cast<std::uint64_t>(std::ceil(scene.time / step))));
  return row;
}

void scan() {
  for (const int dimension : {2, 3})
    for (const double restitution : {1.0, 0.5})
      for (const auto& laws : all_laws())
        for (const double fraction : quick ? std::vector{0.2, 0.5, 1.0, 2.5} : std::vector{0.05, 0.1, 0.2, 0.35, 0.5, 0.7, 1.0, 1.4, 1.8, 2.5}) {
          Setting s;
          s.dimension = dimension;
          s.laws = laws;
          s.restitution = restitution;
          s.stiffness = mass_of(s) / 1e-6;
          auto row = scan_row(s, dimension == 2 ? (quick ? 4 : 5) : 3, fraction);
          row["part"] = "scan";
          print(row);
        }
}

// --- extremes ---------------------------------------------------------------------------------------------------------------

const std::vector<double> fractions{0.2, 0.5, 1.0};

void extreme(const char* scene, const char* what, double value, const Setting& s, const std::vector<Body>& bodies, const std::vector<dem::Wall>& walls,
             double reach, double periods) {
  const double critical = dem::critical_step(scene_of(s, reach)).seconds;
  for (const double fraction : fractions) {
    auto row = about(scene, s);
    row.update({{"part", "extremes"}, {"what", what}, {"value", value}, {"fraction", fraction}});
    row.update(runs(s, bodies, walls, reach, fraction * critical, static_cast<std::uint64_t>(std::ceil(periods / fraction))));
    print(row);
  }
}

Setting with(const LawChoice& laws, int dimension = 3) {
  Setting s;
  s.laws = laws;
  s.dimension = dimension;
  s.stiffness = mass_of(s) / 1e-6;
  return s;
}
const LawChoice hertz{"hertz", "mindlin", "elastic_plastic"}, linear{"linear", "linear_slider", "elastic_plastic"};
const std::vector<LawChoice> both{hertz, linear};

// Three balls let go one above the other, the lowest just above the floor.
void stiffness() {
  for (int decade = 3; decade <= 12; decade += quick ? 3 : 1) {
    auto s = with(linear);
    s.stiffness = std::pow(10, decade);
    s.gravity = 9.81;
    const double r = s.species[0].radius, gap = 0.5 * 9.81 * 100 * mass_of(s) / s.stiffness;  // a fall of some contact times
    std::vector<Body> bodies;
    for (int k = 0; k < 3; ++k) bodies.push_back({Vec3(0, 0, r + gap + k * (2 * r + gap))});
    extreme("three balls dropped", "stiffness [N/m]", s.stiffness, s, bodies, box(3, 1, true), 10 * r, 400);
  }
}

// Heavy balls with light ones between them, all of one size, thrown about in a box.
void masses() {
  for (const auto& laws : both)
    for (int power = 0; power <= 6; power += quick ? 3 : 1) {
      auto s = with(laws);
      const double ratio = std::pow(10, power);
      s.species = {{500000, 0.01, 5e8}, {500000 / ratio, 0.01, 5e8}};
      s.stiffness = 1e6;
      std::mt19937_64 random(5);
      std::uniform_real_distribution<double> even(-1, 1);
      std::vector<Body> bodies;
      for (int k = 0; k < 27; ++k) {
        Body b;
        b.species = static_cast<std::size_t>(k % 2);
        b.at = 0.022 * Vec3(k % 3 + 0.5, k / 3 % 3 + 0.5, k / 9 + 0.5);
        b.velocity = 0.2 * Vec3(even(random), even(random), even(random));
        bodies.push_back(b);
      }
      // Until the heavy ones have met a few times: 0.05 s, at least the steps of equal masses.
      const double critical = dem::critical_step(scene_of(s, 0.066)).seconds;
      extreme("balls in a box", "mass ratio", ratio, s, bodies, box(3, 0.066), 0.066, std::clamp((quick ? 0.01 : 0.04) / critical, 200.0, quick ? 600.0 : 4000.0));
    }
}

// A big ball lands on a layer of small ones.
void sizes() {
  for (const auto& laws : both)
    for (const double ratio : quick ? std::vector{10.0, 100.0} : std::vector{1.0, 3.0, 10.0, 30.0, 100.0}) {
      auto s = with(laws);
      const double small = 1e-3, big = ratio * small;
      s.species = {{2500, small, 1e9}, {2500, big, 1e9}};
      s.stiffness = 1e7;
      s.gravity = 9.81;
      std::vector<Body> bodies;
      for (int i = -2; i <= 2; ++i)
        for (int j = -2; j <= 2; ++j) bodies.push_back({Vec3(2.1 * small * i, 2.1 * small * j, small), Vec3::Zero(), Vec3::Zero(), small, 0});
      bodies.push_back({Vec3(0, 0, 2 * small + big + 1e-6), Vec3(0, 0, -0.05), Vec3(3, 0, 1), big, 1});
      extreme("big ball on small ones", "size ratio", ratio, s, bodies, box(3, 1, true), 10 * big, quick ? 500 : 3000);
    }
}

// Two balls head on, and one more waiting behind; speed over that of waves, sqrt(E/ρ).
void speeds() {
  for (const auto& base : {LawChoice{"hertz"}, LawChoice{"linear"}, hertz, linear})
    for (const double restitution : {1.0, 0.5})
      for (const double share : {1e-4, 1e-3, 1e-2, 0.03, 0.1}) {
        auto s = with(base);
        s.restitution = restitution;
        const double r = 0.01, young = 2.5 * s.species[0].shear_modulus, wave = std::sqrt(young / 2500), speed = share * wave;
        s.stiffness = young * r;
        const std::vector<Body> bodies{{Vec3(-1.001 * r, 0, 0), Vec3(0.5 * speed, 0, 0)}, {Vec3(1.001 * r, 0.2 * r, 0), Vec3(-0.5 * speed, 0, 0)},
                                       {Vec3(3.1 * r, 0.1 * r, 0.1 * r), Vec3(-0.5 * speed, 0, 0)}};
        // Contact of a Hertzian pair lasts as speed^(-1/5); the approach takes 0.1 r.
        const double critical = dem::critical_step(scene_of(s, 1)).seconds;
        extreme("two balls meet", "speed over wave speed", share, s, bodies, {}, 1, std::min(0.4 * r / speed / critical + 60, quick ? 300.0 : 3000.0));
      }
}

void friction_and_restitution() {
  for (const auto& laws : both)
    for (const int dimension : {2, 3}) {
      const auto shake = [&](Setting s, const char* what, double value) {
        const double critical = dem::critical_step(scene_of(s, 1)).seconds;
        const auto scene = shaken(s, dimension == 2 ? 5 : 3);
        extreme("shaken bed", what, value, s, scene.bodies, scene.walls, scene.side, scene.time / critical);
      };
      for (const double friction : {0.0, 10.0}) {
        auto s = with(laws, dimension);
        s.friction = friction;
        shake(s, "friction", friction);
      }
      for (const double restitution : {0.01, 0.1, 1.0}) {
        auto s = with(laws, dimension);
        s.restitution = restitution;
        shake(s, "restitution", restitution);
      }
    }
}

void tower() {
  for (const auto& laws : both) {
    auto s = with(laws);
    s.restitution = 0.1;
    s.gravity = 9.81;
    s.species[0].shear_modulus = 1e8;
    const double r = s.species[0].radius;
    s.stiffness = 1e5;
    const int count = quick ? 20 : 100;
    std::vector<Body> bodies;
    for (int k = 0; k < count; ++k) bodies.push_back({Vec3(0, 0, (2 * k + 1) * r)});
    extreme("tower", "height in balls", count, s, bodies, box(3, 2.2 * count * r, true), 2.2 * count * r, quick ? 300 : 2000);
  }
}

void overlapped() {
  for (const auto& laws : both)
    for (const double restitution : {1.0, 0.5})
      for (const double depth : {0.05, 0.2, 0.5, 1.0, 1.5, 2.0}) {
        auto s = with(laws);
        s.restitution = restitution;
        const double r = s.species[0].radius, apart = (2 - depth) * r;
        extreme("overlapped pair", "overlap over radius", depth, s, {{Vec3(0.3 * apart, 0.3 * apart, std::sqrt(0.82) * apart)}, {Vec3::Zero()}}, {}, 0.5, 100);
      }
  for (const auto& laws : both)
    for (const double depth : {0.1, 0.3, 0.6}) {
      auto s = with(laws);
      const double r = s.species[0].radius, pitch = (2 - depth) * r;
      std::vector<Body> bodies;
      std::mt19937_64 random(5);
      std::uniform_real_distribution<double> even(-0.1, 0.1);
      for (int k = 0; k < 27; ++k)
        bodies.push_back({Vec3(0.02, 0.02, 0.02) + pitch * Vec3(k % 3 + even(random), k / 3 % 3 + even(random), k / 9 + even(random))});
      extreme("overlapped bed", "overlap over radius", depth, s, bodies, box(3, 0.12), 0.12, 300);
    }
}

// --- at rest ----------------------------------------------------------------------------------------------------------------

void rest() {
  for (const int dimension : {2, 3})
    for (const auto& laws : both) {
      auto s = with(laws, dimension);
      s.restitution = 0.3;
      s.gravity = 9.81;
      s.ledger = true;
      const double r = s.species[0].radius;
      // A pile that friction and rolling resistance hold, on a floor without sides.
      std::vector<Body> bodies;
      const auto put = [&](double x, double y, double z) { bodies.push_back({dimension == 2 ? Vec3(x, z, 0) : Vec3(x, y, z)}); };
      const int base = quick ? 2 : 3;
      for (int layer = 0; layer < base; ++layer)
        for (int i = 0; i < base - layer; ++i)
          for (int j = 0; j < (dimension == 2 ? 1 : base - layer); ++j)
            put((2 * i + layer) * r, (2 * j + layer) * r, r + layer * (dimension == 2 ? std::sqrt(3.0) : std::sqrt(2.0)) * r);
      const double step = 0.2 * dem::critical_step(scene_of(s, 1)).seconds;
      const auto engine = engine_of(scene_of(s, 1), bodies, box(dimension, 1, true));
      engine->advance(quick ? 40000 : 100000, step);
      const auto before = engine->particles();
      const auto energy = engine->energy();
      for (int k = 0; k < 100; ++k) engine->advance(10000, step);
      const auto& after = engine->particles();
      double moved = 0, fastest = 0;
      for (std::size_t i = 0; i < before.size(); ++i)
        for (std::size_t k = 0; k < after.size(); ++k)
          if (after.id[k] == before.id[i]) {
            moved = std::max(moved, (after.position[k].vector() - before.position[i].vector()).norm() / r);
            fastest = std::max(fastest, after.velocity_of(k).norm());
          }
      const auto now = engine->energy();
      // On the scale of the springs' energy, the only one there is at rest.
      const double scale = energy.normal + energy.tangential + energy.rolling;
      print({{"part", "rest"}, {"dimension", dimension}, {"laws", laws.text()}, {"particles", bodies.size()}, {"steps", 1000000}, {"step", step},
             {"moved", moved}, {"fastest", fastest}, {"drift", (now.drift - energy.drift) / scale}, {"kinetic", now.kinetic / scale},
             {"stored", (now.stored() - energy.stored()) / scale}, {"lost", (now.lost() - energy.lost()) / scale}});
    }
}

}  // namespace

int main(int count, char** words) {
  const std::string part = count > 1 ? words[1] : "";
  quick = count > 2 && std::strcmp(words[2], "--quick") == 0;
  if (part == "limits") limits();
  else if (part == "scan") scan();
  else if (part == "extremes") {
    stiffness();
    masses();
    sizes();
    speeds();
    friction_and_restitution();
    tower();
    overlapped();
  } else if (part == "rest") rest();
  else {
    fmt::print(stderr, "usage: dem_stability limits | scan | extremes | rest [--quick]\n");
    return 2;
  }
}
