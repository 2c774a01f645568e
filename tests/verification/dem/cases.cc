#include "cases.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>

#include "dem/step.h"
#include "setup.h"

namespace acopla::dem::verification {
namespace {

using Json = nlohmann::json;

double disc_mass(double radius, double density) { return density * M_PI * radius * radius; }
double sphere_mass(double radius, double density) { return density * 4 / 3 * M_PI * radius * radius * radius; }

/// An engine with a clock, a step, and an outcome that fills.
class Run {
 public:
  Run(double step, std::unique_ptr<Engine> moving, Outcome& outcome) : engine(std::move(moving)), step_(step), outcome_(outcome) {
    outcome.step = step;
  }
  void advance(std::uint64_t steps = 1) { advance(steps, step_); }
  /// In equal steps, none longer than the run's.
  void to(double time) {
    const double left = time - engine->time();
    if (left <= 0) return;
    const auto steps = static_cast<std::uint64_t>(std::ceil(left / step_ * (1 - 1e-12)));
    advance(steps, left / static_cast<double>(steps));
  }
  std::unique_ptr<Engine> engine;

 private:
  void advance(std::uint64_t steps, double step) {
    const auto start = std::chrono::steady_clock::now();
    engine->advance(steps, step);
    outcome_.seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    outcome_.steps += steps;
  }
  double step_;
  Outcome& outcome_;
};

void add(Outcome& outcome, std::string name, double value, double expected, double scale = 0) {
  outcome.figures.push_back({std::move(name), value, expected, scale > 0 ? scale : std::abs(expected)});
}

Vec3 down(double slope = 0) { return standard_gravity * Vec3(std::sin(slope), -std::cos(slope), 0); }

void set_damping_ratio(Scene& scene, double zeta) {
  for (auto& pair : scene.pairs) pair.damping_ratio = zeta;
}

/// The top of the parabola through the last three values, once the middle one was the largest.
class Peak {
 public:
  void add(double value) {
    if (middle_ > first_ && middle_ >= value) {
      const double bend = first_ - 2 * middle_ + value;
      highest_ = std::max(highest_, bend < 0 ? middle_ - (value - first_) * (value - first_) / (8 * bend) : middle_);
    }
    first_ = middle_;
    middle_ = value;
  }
  double value() const { return highest_; }

 private:
  double first_ = 0, middle_ = 0, highest_ = 0;
};

}  // namespace

double Figure::error() const { return std::abs(value - reference) / scale; }

double Outcome::worst(const std::string& prefix) const {
  double worst = 0;
  for (const auto& figure : figures)
    if (figure.name.compare(0, prefix.size(), prefix) == 0) worst = std::isnan(figure.error()) ? NAN : std::max(worst, figure.error());
  return worst;
}

// --- impacts -------------------------------------------------------------------------------------------------------------

Outcome elastic_collision(double fraction, std::size_t soft) {
  const auto& about = reference()["elastic_collision"];
  const auto& p = about["parameters"];
  const auto& expected = about["values"]["soft"][soft];
  const double r1 = p["radius_1"], r2 = p["radius_2"], m = p["mass"], offset = p["offset"], speed = p["speed"];
  OneMaterial setup;
  setup.dimension = 2;
  setup.radius = r1;
  setup.density = m / (M_PI * r1 * r1);
  setup.normal = linear(expected["stiffness"]);
  const auto scene = scene_of(setup);
  Outcome outcome;
  const double step = fraction * critical_step(scene).seconds, touch = p["contact_begins_at"][0], duration = expected["duration"];
  for (int phase = 0; phase < 8; ++phase) {
    const double start = touch - speed * step * (1 + phase / 8.0);
    Run run(step, engine_of(scene, {{Vec3(start, offset, 0), r1, Vec3(speed, 0, 0)},
                                    {Vec3(0, 0, 0), r2, Vec3::Zero(), Vec3::Zero(), m / (M_PI * r2 * r2)}}), outcome);
    run.advance(static_cast<std::uint64_t>(1.2 * duration / step) + 5);
    const Vec3 v1 = velocity(*run.engine, 0), v2 = velocity(*run.engine, 1);
    for (int d = 0; d < 2; ++d) {
      add(outcome, fmt::format("velocity 1.{} [m/s]", "xy"[d]), v1[d], expected["speed_1"][d], speed);
      add(outcome, fmt::format("velocity 2.{} [m/s]", "xy"[d]), v2[d], expected["speed_2"][d], speed);
    }
    add(outcome, "angle 1 [degrees]", std::atan2(v1[1], v1[0]) * 180 / M_PI, expected["angle_1_degrees"]);
    add(outcome, "angle 2 [degrees]", std::atan2(v2[1], v2[0]) * 180 / M_PI, expected["angle_2_degrees"]);
  }
  return outcome;
}

Outcome hertz_head_on(double fraction) {
  const auto& about = reference()["hertz_head_on"];
  const auto &p = about["parameters"], &expected = about["values"];
  // Two materials, so a case text of its own.
  const std::string text = fmt::format(
      "dimension = 3\nend = 1.0\n[g]\nsolver = \"dem\"\n[g.material.a]\ndensity = {}\nyoung = {}\npoisson = {}\n[g.material.b]\ndensity = {}\n"
      "young = {}\npoisson = {}\n[[g.contact]]\nbetween = [[\"a\", \"b\"], [\"a\", \"a\"], [\"b\", \"b\"]]\nnormal = \"hertz\"\nrestitution = 1\n"
      "[[g.insert]]\nmaterial = \"a\"\ndiameter = {}\ncount = 1\nregion = {{ box = [[-1, -1, -1], [1, 1, 1]] }}\n"
      "[[g.insert]]\nmaterial = \"b\"\ndiameter = {}\ncount = 1\nregion = {{ box = [[-1, -1, -1], [1, 1, 1]] }}\n",
      p["density"][0].get<double>(), p["young"][0].get<double>(), p["poisson"][0].get<double>(), p["density"][1].get<double>(),
      p["young"][1].get<double>(), p["poisson"][1].get<double>(), 2 * p["radius"][0].get<double>(), 2 * p["radius"][1].get<double>());
  const auto scene = read_scene(io::Table::from_text(text, "verification.toml"), "g");
  const double speed = p["closing_speed"], r1 = p["radius"][0], r2 = p["radius"][1], step = fraction * critical_step(scene).seconds;
  const double gap = 0.37 * speed * step;
  Particles particles;
  particles.kind = scene.kind();
  particles.add(Vec3(-r1 - gap, 0, 0), r1, p["density"][0], 0, Vec3(speed, 0, 0));
  particles.add(Vec3(r2, 0, 0), r2, p["density"][1], 1, Vec3::Zero());
  Outcome outcome;
  Run run(step, make_engine(scene, std::move(particles)), outcome);
  const double m1 = mass(*run.engine, 0);
  Peak overlap, force;
  double before = m1 * speed, span = 0;
  do {
    run.advance();
    span = position(*run.engine, 1)[0] - position(*run.engine, 0)[0];
    overlap.add(r1 + r2 - span);
    const double momentum = m1 * velocity(*run.engine, 0)[0];  // v_n − v_{n−1} is the mean of the forces at both ends
    force.add((before - momentum) / step);
    before = momentum;
  } while (span < r1 + r2 || velocity(*run.engine, 1)[0] <= velocity(*run.engine, 0)[0]);
  const double apart = velocity(*run.engine, 1)[0] - velocity(*run.engine, 0)[0];
  add(outcome, "peak overlap [m]", overlap.value(), expected["peak_overlap"]);
  add(outcome, "peak force [N]", force.value(), expected["peak_force"]);
  add(outcome, "duration [s]", run.engine->time() - gap / speed - (span - r1 - r2) / apart, expected["duration"]);
  add(outcome, "separation speed [m/s]", apart, speed);
  return outcome;
}

Outcome restitution(double fraction, const std::string& normal, double e, bool paper) {
  const auto& expected = reference()["restitution"]["values"][fmt::format("{}", e)];
  const bool hertz = normal == "hertz";
  OneMaterial setup;
  if (hertz) {
    setup.normal = "\"hertz\"";
    setup.shear_modulus = 5e6;
    setup.poisson = 0.25;
  } else {
    setup.normal = linear(1e4);
  }
  setup.restitution = e;
  setup.paper = paper;
  const auto scene = scene_of(setup);
  const double r = setup.radius, m = sphere_mass(r, setup.density), speed = 0.5, step = fraction * critical_step(scene).seconds;
  const double reference_e = paper ? expected["restitution_of_printed"].get<double>() : e;
  // Units of the impact: overlap and time.
  const double stiffness = hertz ? 4.0 / 3 * scene.pairs[0].modulus * std::sqrt(r) : 1e4;
  const double depth = hertz ? std::pow(m * speed * speed / stiffness, 0.4) : speed * std::sqrt(m / stiffness);
  Outcome outcome;
  const int phases = 16;
  double sum = 0;
  for (int phase = 0; phase < phases; ++phase) {
    const double gap = speed * step * (phase + 0.5) / phases;
    Run run(step, engine_of(scene, {{Vec3(0, 0, r + gap), r, Vec3(0, 0, -speed)}}, {plane(Vec3::Zero(), Vec3::UnitZ())}), outcome);
    Peak overlap;
    Vec3 x, v;
    do {
      run.advance();
      x = position(*run.engine);
      v = velocity(*run.engine);
      overlap.add(r - x[2]);
    } while (run.engine->contact_count() > 0 || v[2] <= 0);
    add(outcome, fmt::format("restitution {}", phase), v[2] / speed, reference_e, 1);
    sum += v[2] / speed;
    if (paper) continue;
    add(outcome, fmt::format("peak overlap {}", phase), overlap.value() / depth,
        expected[hertz ? "hertz_peak_overlap" : "linear_peak_overlap"]);
  }
  add(outcome, "mean restitution", sum / phases, reference_e, 1);
  return outcome;
}

Outcome oblique_impact(double fraction, double e, double tangential) {
  const auto& about = reference()["oblique_impact"];
  const auto& p = about["parameters"];
  const auto& expected = about["values"][fmt::format("e_{:g}_tangential_{:g}_engine", e, tangential)];
  OneMaterial setup;
  setup.radius = p["radius"];
  setup.density = p["density"];
  setup.normal = linear(p["normal_stiffness"]);
  setup.tangential = linear_slider(p["stiffness_ratio"], 0);
  setup.friction = p["friction"];
  setup.restitution = e;
  const auto scene = scene_of(setup);
  const double r = setup.radius, step = fraction * critical_step(scene).seconds, speed = p["normal_speed"], duration = expected["duration"];
  Outcome outcome;
  for (int phase = 0; phase < 8; ++phase) {
    Run run(step, engine_of(scene, {{Vec3(0, r + speed * step * (phase + 0.5) / 8, 0), r, Vec3(tangential, -speed, 0)}},
                            {plane(Vec3::Zero(), Vec3::UnitY())}), outcome);
    run.advance(static_cast<std::uint64_t>(1.2 * duration / step) + 5);
    const Vec3 v = velocity(*run.engine);
    add(outcome, "normal speed [m/s]", v[1], expected["normal_speed"], speed);
    add(outcome, "tangential speed [m/s]", v[0], expected["tangential_speed"], speed);
    add(outcome, "spin · r [m/s]", spin(*run.engine)[2] * r, expected["spin"].get<double>() * r, speed);
  }
  return outcome;
}

Outcome bouncing_ball(double fraction, const std::string& law, double e) {
  const auto& p = reference()["bouncing_ball"]["parameters"];
  const auto& expected = reference()["bouncing_ball"]["values"][fmt::format("{}_e_{:g}", law, e)];
  const double stiffness = expected["stiffness"];
  OneMaterial setup;
  setup.gravity = down();
  setup.radius = p["radius"];
  setup.density = p["density"];
  setup.restitution = e;
  const double r = setup.radius, gap = p["gap"];
  if (law.rfind("hertz", 0) == 0) {
    // Y* = E/(2 (1 − ν²)) of two equal bodies and K = 4/3 Y* sqrt(r)
    const double modulus = stiffness / (4.0 / 3 * std::sqrt(r));
    setup.normal = "\"hertz\"";
    setup.poisson = 0.25;
    setup.shear_modulus = modulus * 2 * (1 - 0.25 * 0.25) / (2 * 1.25);
  } else {
    setup.normal = linear(stiffness);
  }
  const auto scene = scene_of(setup);
  Outcome outcome;
  Run run(fraction * critical_step(scene).seconds, engine_of(scene, {{Vec3(0, r + gap, 0), r}}, {plane(Vec3::Zero(), Vec3::UnitY())}), outcome);
  int count = 0;
  for (const auto& bounce : expected["bounces"]) {
    ++count;
    Peak overlap;
    double height = 0, speed = 0;
    bool touched = false;
    do {
      run.advance();
      height = position(*run.engine)[1] - r;
      speed = velocity(*run.engine)[1];
      overlap.add(-height);
      touched = touched || height < 0;
    } while (!touched || height < 0 || speed <= 0);
    // In flight the steps are exact.
    add(outcome, fmt::format("height {} [m]", count), height + speed * speed / (2 * standard_gravity), bounce["height"], gap);
    add(outcome, fmt::format("apex {} [s]", count), run.engine->time() + speed / standard_gravity, bounce["apex"]);
    add(outcome, fmt::format("peak overlap {} [m]", count), overlap.value(), bounce["peak_overlap"]);
  }
  return outcome;
}

// --- rolling -------------------------------------------------------------------------------------------------------------

namespace {

/// A disc or sphere settled on a floor, then set moving; everything that reference.py's rolling_body holds.
struct Roller {
  bool disc = true;
  double radius = 0, density = 0, normal_stiffness = 0, shear_stiffness = 0, shear_dashpot = 0, friction = 0;
  double rolling_stiffness = 0, rolling_dashpot = 0, rolling_friction = 0, twisting = 0;  // no rolling law if the stiffness is 0
  double slope = 0;
  Vec3 velocity = Vec3::Zero(), spin = Vec3::Zero();

  double mass() const { return disc ? disc_mass(radius, density) : sphere_mass(radius, density); }
  double inertia() const { return (disc ? 0.5 : 0.4) * mass() * radius * radius; }
};

Run put_down(const Roller& roller, double fraction, Outcome& outcome) {
  OneMaterial setup;
  setup.dimension = roller.disc ? 2 : 3;
  setup.gravity = down(roller.slope);
  setup.radius = roller.radius;
  setup.density = roller.density;
  setup.normal = linear(roller.normal_stiffness);
  const double m = roller.mass(), at_foot = roller.inertia() + m * roller.radius * roller.radius;
  setup.tangential = linear_slider(roller.normal_stiffness / roller.shear_stiffness,
                                   roller.shear_dashpot / (2 * std::sqrt(roller.shear_stiffness * m)));
  setup.friction = roller.friction;
  if (roller.rolling_stiffness > 0) {
    setup.rolling = elastic_plastic(roller.rolling_dashpot / (2 * std::sqrt(at_foot * roller.rolling_stiffness)),
                                    roller.rolling_stiffness / (roller.shear_stiffness * roller.radius * roller.radius), roller.twisting);
    setup.rolling_friction = roller.rolling_friction;
  }
  const auto scene = scene_of(setup);
  const double overlap = m * standard_gravity * std::cos(roller.slope) / roller.normal_stiffness;
  return Run(fraction * critical_step(scene).seconds,
             engine_of(scene, {{Vec3(0, roller.radius - overlap, 0), roller.radius, roller.velocity, roller.spin}},
                       {plane(Vec3::Zero(), Vec3::UnitY())}), outcome);
}

/// x, v and ω r at the reference's instants: [t, x, v, ω, …].
void compare_samples(Run& run, const Json& samples, double radius, double distance, double speed, Outcome& outcome) {
  for (const auto& sample : samples) {
    const double t = sample[0];
    run.to(t);
    add(outcome, fmt::format("x at {:g} s [m]", t), position(*run.engine)[0], sample[1], distance);
    add(outcome, fmt::format("v at {:g} s [m/s]", t), velocity(*run.engine)[0], sample[2], speed);
    add(outcome, fmt::format("ω r at {:g} s [m/s]", t), spin(*run.engine)[2] * radius, sample[3].get<double>() * radius, speed);
  }
}

/// Where and when the velocity along x first changes its sign.
void compare_standstill(Run& run, const Json& expected, Outcome& outcome) {
  const double end = 1.2 * expected[0].get<double>();
  double before = velocity(*run.engine)[0], time = run.engine->time();
  while (run.engine->time() < end) {
    run.advance();
    const double v = velocity(*run.engine)[0];
    if (v <= 0 && before > 0) {
      const double share = before / (before - v), step = run.engine->time() - time;
      add(outcome, "standstill [s]", time + share * step, expected[0]);
      add(outcome, "distance [m]", position(*run.engine)[0] - 0.5 * v * (1 - share) * step, expected[1]);
      return;
    }
    before = v;
    time = run.engine->time();
  }
  add(outcome, "standstill [s]", NAN, expected[0]);
}

}  // namespace

Outcome struck_ball(double fraction, const std::string& key) {
  const auto& about = reference()["struck_ball"];
  const auto& p = about["parameters"];
  const auto& expected = about["values"]["soft"][key];
  Roller roller;
  roller.disc = key.rfind("disc", 0) == 0;
  roller.radius = p["radius"];
  const double m = p["mass"], factor = key.find("x100") == std::string::npos ? 1 : 100;
  roller.density = m / (roller.disc ? disc_mass(roller.radius, 1) : sphere_mass(roller.radius, 1));
  roller.normal_stiffness = p["normal_stiffness"];
  roller.shear_stiffness = p["tangential_stiffness"].get<double>() * factor;
  roller.shear_dashpot = p["tangential_damping"].get<double>() * std::sqrt(factor);
  roller.friction = p["friction"];
  roller.velocity = Vec3(p["speed"], 0, 0);
  roller.spin = Vec3(0, 0, p["spin"]);
  Outcome outcome;
  auto run = put_down(roller, fraction, outcome);
  compare_samples(run, expected["samples_t_x_v_w"], roller.radius, 0.2, 1, outcome);
  return outcome;
}

namespace {

/// What reference.json says of a key of rolling_consistent or rolling_printed.
const Json& rolling_reference(const std::string& key) {
  return key.rfind("r_0", 0) == 0 ? reference()["rolling_printed"]["values"][key] : reference()["rolling_consistent"]["values"]["soft"][key];
}

Roller roller_of(const std::string& key) {
  const bool printed = key.rfind("r_0", 0) == 0;
  const auto& p = reference()[printed ? "rolling_printed" : "rolling_consistent"]["parameters"];
  Roller roller;
  roller.disc = key.rfind("sphere", 0) != 0;
  roller.density = p["density"];
  roller.friction = 0.8;
  roller.rolling_friction = 0.2;
  if (printed) {  // table 3.3 as it stands
    roller.radius = key.rfind("r_0.05", 0) == 0 ? 0.05 : 0.005;
    roller.normal_stiffness = p["normal_stiffness"];
    roller.shear_stiffness = 3.3e3;
    roller.shear_dashpot = 5.7;
    roller.rolling_stiffness = 8.1e-2;
    roller.rolling_dashpot = key.find("without") == std::string::npos ? 0.004 : 0;
  } else {
    roller.radius = p["radius"];
    const double r = roller.radius, factor = key.find("x100") == std::string::npos ? 1 : 100;
    const double scale = roller.disc ? 1 : 4 * r / 3;  // the sphere's springs for the same static overlap
    const auto number = [&](const char* before, double fallback) {
      const auto at = key.find(before);
      return at == std::string::npos ? fallback : std::stod(key.substr(at + std::string(before).size()));
    };
    roller.normal_stiffness = p["normal_stiffness"].get<double>() * scale;
    roller.shear_stiffness = p["tangential_stiffness"].get<double>() * scale * factor;
    roller.shear_dashpot = p["tangential_damping"].get<double>() * scale * std::sqrt(factor);
    roller.rolling_stiffness = roller.shear_stiffness * r * r * number("k_r_x", 1);
    roller.rolling_dashpot = 2 * number("eta_", 0.3) * std::sqrt((roller.inertia() + roller.mass() * r * r) * roller.rolling_stiffness);
    roller.rolling_friction = number("mu_r_", 0.2);
  }
  roller.velocity = Vec3(p["speed"], 0, 0);
  return roller;
}

}  // namespace

Outcome rolling(double fraction, const std::string& key) {
  const auto& expected = rolling_reference(key);
  const auto roller = roller_of(key);
  Outcome outcome;
  auto run = put_down(roller, fraction, outcome);
  compare_samples(run, expected["samples_t_x_v_w_force_couple"], roller.radius, expected["largest_distance"], 1, outcome);
  if (!expected["first_standstill"].is_null()) {
    auto again = put_down(roller, fraction, outcome);
    compare_standstill(again, expected["first_standstill"], outcome);
  }
  return outcome;
}

std::vector<RollingState> rolling_trace(double fraction, const std::string& key, double end, int count) {
  const auto roller = roller_of(key);
  const double arm = roller.radius - roller.mass() * standard_gravity / roller.normal_stiffness;
  Outcome outcome;
  auto run = put_down(roller, fraction, outcome);
  std::vector<RollingState> trace;
  for (int k = 1; k <= count; ++k) {
    run.to(end * k / count - 1.5 * outcome.step);
    const double v = velocity(*run.engine)[0], w = spin(*run.engine)[2], time = run.engine->time();
    run.advance(2);
    const double span = run.engine->time() - time;
    const double force = roller.mass() * (velocity(*run.engine)[0] - v) / span;
    // I ω' = a F + M
    const double couple = roller.inertia() * (spin(*run.engine)[2] - w) / span - arm * force;
    trace.push_back({time + 0.5 * span, position(*run.engine)[0], 0.5 * (v + velocity(*run.engine)[0]), spin(*run.engine)[2], couple});
  }
  return trace;
}

Outcome incline(double fraction, const std::string& key) {
  const auto& about = reference()["incline"];
  const auto& p = about["parameters"];
  const auto& expected = about["values"][key];
  Roller roller;
  roller.disc = key.rfind("disc", 0) == 0;
  roller.radius = p["radius"];
  roller.density = p["density"];
  const double r = roller.radius, scale = roller.disc ? 1 : 4 * r / 3;
  roller.normal_stiffness = 6.5e4 * scale;
  roller.shear_stiffness = p["tangential_stiffness"].get<double>() * scale;
  roller.shear_dashpot = p["tangential_damping"].get<double>() * scale;
  roller.rolling_stiffness = p["rolling_stiffness"].get<double>() * scale;
  roller.rolling_dashpot = 2 * p["eta_r"].get<double>() * std::sqrt((roller.inertia() + roller.mass() * r * r) * roller.rolling_stiffness);
  roller.friction = p["friction"];
  roller.rolling_friction = p["rolling_friction"];
  roller.slope = expected["slope_degrees"].get<double>() * M_PI / 180;
  Outcome outcome;
  auto run = put_down(roller, fraction, outcome);
  const auto& samples = expected["engine_samples_t_x_v_w"];
  const double distance = std::abs(samples.back()[1].get<double>()), speed = 0.2 * standard_gravity * std::sin(roller.slope);
  compare_samples(run, samples, r, distance, speed, outcome);
  // While it rolls, with the couple at its limit μ_r r N and friction at the arm a: v' (m + I/a²) = m g sin θ − μ_r r N / a.
  const bool rolls = std::abs(samples.back()[2].get<double>()) > 1e-4;
  const double arm = r - roller.mass() * standard_gravity * std::cos(roller.slope) / roller.normal_stiffness;
  const double rolling = standard_gravity * (std::sin(roller.slope) - roller.rolling_friction * std::cos(roller.slope) * r / arm) /
                         (1 + roller.inertia() / (roller.mass() * arm * arm));
  const double before = velocity(*run.engine)[0];
  run.to(run.engine->time() + 0.1);
  add(outcome, "acceleration afterwards [m/s²]", (velocity(*run.engine)[0] - before) / 0.1, rolls ? rolling : 0, 0.2 * standard_gravity);
  return outcome;
}

Outcome spin_decay(double fraction, const std::string& key) {
  const auto& about = reference()["spin_decay"];
  const auto& p = about["parameters"];
  const auto& expected = about["values"][key];
  const bool torsion = key.rfind("torsion", 0) == 0;
  Roller roller;
  roller.disc = false;
  roller.radius = p["radius"];
  roller.density = p["density"];
  roller.shear_stiffness = p["tangential_stiffness"];
  roller.normal_stiffness = 20 * roller.shear_stiffness;
  roller.rolling_stiffness = expected["stiffness"];
  roller.rolling_dashpot = expected["dashpot"];
  roller.rolling_friction = p["coefficient"];
  roller.friction = torsion ? 0.5 : 0;
  roller.twisting = torsion ? 1 : 0;
  const double start = p["spin"];
  roller.spin = torsion ? Vec3(0, start, 0) : Vec3(0, 0, start);
  Outcome outcome;
  auto run = put_down(roller, fraction, outcome);
  const auto spin_now = [&] { return spin(*run.engine)[torsion ? 1 : 2]; };
  for (const auto& sample : expected["samples_t_w"]) {
    run.to(sample[0]);
    add(outcome, fmt::format("spin at {:.4g} s [rad/s]", sample[0].get<double>()), spin_now(), sample[1], start);
  }
  double before = spin_now(), time = run.engine->time();
  while (before > 0 && time < 1) {
    run.advance();
    const double now = spin_now();
    if (now <= 0) add(outcome, "first stops at [s]", time + before / (before - now) * (run.engine->time() - time), expected["stops_at"]);
    before = now;
    time = run.engine->time();
  }
  run.to(1.0);
  add(outcome, "spin at the end [rad/s]", spin_now(), 0, start);
  return outcome;
}

// --- statics -------------------------------------------------------------------------------------------------------------

namespace {

OneMaterial resting(const std::string& law) {
  const auto& p = reference()["statics"]["parameters"];
  OneMaterial setup;
  setup.density = p["density"];
  setup.restitution = 0.1;
  if (law == "hertz") {
    // Y* = E/(2 (1 − ν²)) of two equal bodies.
    setup.normal = "\"hertz\"";
    setup.poisson = 0.25;
    setup.shear_modulus = p["reduced_modulus_of_every_pair"].get<double>() * 2 * (1 - 0.25 * 0.25) / (2 * 1.25);
  } else {
    setup.normal = linear(p["linear_stiffness"]);
  }
  // The dashpots of contacts with a small particle are small: a drag of 1000 m v takes the swings of the large ones, and nothing at rest.
  setup.more = "damping = { viscous = { translation = 1000 } }";
  return setup;
}

}  // namespace

Outcome column(double fraction, const std::string& key, const std::vector<double>& radii) {
  const auto& expected = reference()["statics"]["values"][key];
  auto setup = resting(key.find("hertz") == std::string::npos ? "linear" : "hertz");
  setup.gravity = down();
  setup.radius = *std::min_element(radii.begin(), radii.end());
  const auto scene = scene_of(setup);
  std::vector<Body> bodies;
  double height = 0;
  for (const double r : radii) {
    bodies.push_back({Vec3(0, height + r, 0), r});
    height += 2 * r;
  }
  Outcome outcome;
  Run run(fraction * critical_step(scene).seconds, engine_of(scene, bodies, {plane(Vec3::Zero(), Vec3::UnitY())}), outcome);
  run.to(0.05);
  run.advance();  // loads are means over a window
  for (std::uint32_t k = 0; k < radii.size(); ++k)
    add(outcome, fmt::format("centre {} [m]", k), position(*run.engine, k)[1], expected["centres"][k]);
  add(outcome, "force on the floor [N]", -run.engine->wall_load().walls[0].force[1], expected["forces"][0]);
  return outcome;
}

Outcome squeezed_row(double fraction, const std::string& key, const std::string& law) {
  const auto& expected = reference()["statics"]["values"][key];
  const double small = key == "row_ratio_10" ? 0.001 : 0.0001, r = 0.01, gap = expected["gap_between_walls"];
  auto setup = resting(law);
  setup.radius = small;
  const auto scene = scene_of(setup);
  // The squeeze shared equally at first; the bodies find their places.
  const double share = expected["squeeze"].get<double>() / 4;
  const double a = r - share, b = a + r + small - share, c = b + small + r - share;
  Outcome outcome;
  Run run(fraction * critical_step(scene).seconds,
          engine_of(scene, {{Vec3(a, 0, 0), r}, {Vec3(b, 0, 0), small}, {Vec3(c, 0, 0), r}},
                    {plane(Vec3::Zero(), Vec3::UnitX()), plane(Vec3(gap, 0, 0), -Vec3::UnitX())}), outcome);
  run.to(0.05);
  run.advance();
  add(outcome, "force on the first wall [N]", -run.engine->wall_load().walls[0].force[0], expected[law + "_force"]);
  add(outcome, "force on the second wall [N]", run.engine->wall_load().walls[1].force[0], expected[law + "_force"]);
  add(outcome, "overlap with the small one [m]", r + small - (position(*run.engine, 1)[0] - position(*run.engine, 0)[0]),
      law == "linear" ? expected["linear_overlap"].get<double>() : expected["hertz_overlaps"][1].get<double>());
  return outcome;
}

// --- contacts that stay closed ---------------------------------------------------------------------------------------------

Outcome free_vibration(double fraction, double zeta) {
  const auto& about = reference()["free_vibration"];
  const auto &p = about["parameters"], &values = about["values"];
  const auto& expected = values[fmt::format("zeta_{:g}", zeta)];
  OneMaterial setup;
  setup.gravity = down();
  setup.radius = p["radius"];
  setup.density = p["density"];
  setup.normal = linear(p["stiffness"]);
  auto scene = scene_of(setup);
  const double step = fraction * critical_step(scene).seconds;  // of the spring alone
  set_damping_ratio(scene, zeta);
  const double r = setup.radius, rest = r - values["static_overlap"].get<double>(), speed = p["upward_speed"];
  Outcome outcome;
  Run run(step, engine_of(scene, {{Vec3(0, rest, 0), r, Vec3(0, speed, 0)}}, {plane(Vec3::Zero(), Vec3::UnitY())}), outcome);
  for (const auto& sample : expected["samples_t_rise_v"]) {
    run.to(sample[0]);
    add(outcome, fmt::format("rise at {:.4g} s [m]", sample[0].get<double>()), position(*run.engine)[1] - rest, sample[1], values["amplitude_undamped"]);
    add(outcome, fmt::format("v at {:.4g} s [m/s]", sample[0].get<double>()), velocity(*run.engine)[1], sample[2], speed);
  }
  return outcome;
}

namespace {

/// Damped cosine and sine of a linear oscillator that starts at rest position with rate 1: its place after a time.
double oscillation(double omega, double zeta, double time) {
  const double damped = omega * std::sqrt(1 - zeta * zeta);
  return std::exp(-zeta * omega * time) * std::sin(damped * time) / damped;
}

constexpr double swings = 1.3;  // how many periods the oscillations are followed

}  // namespace

Outcome normal_oscillation(double fraction, double zeta) {
  OneMaterial setup;
  setup.gravity = down();
  setup.normal = linear(1e4);
  auto scene = scene_of(setup);
  const double r = setup.radius, m = sphere_mass(r, setup.density), omega = std::sqrt(1e4 / m), rest = r - m * standard_gravity / 1e4;
  const double speed = 0.3 * (r - rest) * omega, end = swings * 2 * M_PI / omega;
  const double step = fraction * critical_step(scene).seconds;
  set_damping_ratio(scene, zeta);
  Outcome outcome;
  Run run(step, engine_of(scene, {{Vec3(0, rest, 0), r, Vec3(0, speed, 0)}}, {plane(Vec3::Zero(), Vec3::UnitY())}), outcome);
  run.to(end);
  add(outcome, "rise [m]", position(*run.engine)[1] - rest, speed * oscillation(omega, zeta, end), speed / omega);
  return outcome;
}

Outcome tangential_oscillation(double fraction, double zeta) {
  // A sphere that cannot turn would be x'' = −k_t x / m; a free one swings on the spring about its own centre of percussion: slip s obeys
  // s'' = −k_t (1/m + a²/I) s, a the arm, and the sum of both motions keeps I ω − m a v.
  Roller roller;
  roller.disc = false;
  roller.radius = 0.01;
  roller.density = 2500;
  roller.normal_stiffness = 1e4;
  roller.shear_stiffness = 500;
  const double m = roller.mass(), inertia = roller.inertia(), arm = roller.radius - m * standard_gravity / roller.normal_stiffness;
  const double compliance = 1 / m + arm * arm / inertia, omega = std::sqrt(roller.shear_stiffness * compliance);
  roller.shear_dashpot = 2 * zeta * omega / compliance;
  roller.friction = 1e3;
  const double speed = 1e-3, end = swings * 2 * M_PI / omega;
  roller.velocity = Vec3(speed, 0, 0);
  Outcome outcome;
  auto run = put_down(roller, fraction, outcome);
  run.to(end);
  // ∫ F dt = −m Δv with s' = v + a ω and a I-weighted share: v − v_0 = (s' − s'_0)/(m compliance), so x = v_0 t + (s − s'_0 t)/(m compliance).
  const double slip = speed * oscillation(omega, zeta, end), share = 1 / (m * compliance);
  add(outcome, "x [m]", position(*run.engine)[0], speed * end + share * (slip - speed * end), speed / omega);
  return outcome;
}

Outcome rolling_oscillation(double fraction, double zeta) {
  Roller roller;
  roller.disc = false;
  roller.radius = 0.01;
  roller.density = 2500;
  roller.normal_stiffness = 1e4;
  roller.shear_stiffness = 500;
  roller.rolling_stiffness = 500 * 1e-4;
  const double omega = std::sqrt(roller.rolling_stiffness / roller.inertia());
  roller.rolling_dashpot = 2 * zeta * std::sqrt(roller.rolling_stiffness * roller.inertia());
  roller.rolling_friction = 1e3;
  const double rate = 0.1, end = swings * 2 * M_PI / omega;  // on a frictionless floor the sphere turns about its centre
  roller.spin = Vec3(0, 0, rate);
  Outcome outcome;
  auto run = put_down(roller, fraction, outcome);
  run.to(end);
  const double damped = omega * std::sqrt(1 - zeta * zeta);
  const double expected = rate * std::exp(-zeta * omega * end) * (std::cos(damped * end) - zeta * omega / damped * std::sin(damped * end));
  add(outcome, "spin [rad/s]", spin(*run.engine)[2], expected, rate);
  return outcome;
}

// --- what the study sweeps ---------------------------------------------------------------------------------------------------

std::vector<Case> cases() {
  std::vector<Case> all;
  const auto add = [&](std::string name, std::string law, double order, std::function<Outcome(double)> run) {
    all.push_back({std::move(name), std::move(law), order, std::move(run)});
  };
  add("elastic collision", "linear", 3, [](double f) { return elastic_collision(f, 1); });
  add("struck disc", "linear slider", 1, [](double f) { return struck_ball(f, "disc_engine_stiffness_x100"); });
  add("struck sphere", "linear slider", 1, [](double f) { return struck_ball(f, "sphere_engine_stiffness_x100"); });
  add("rolling disc", "elastic-plastic", 1, [](double f) { return rolling(f, "disc_engine_stiffness_x1"); });
  add("rolling sphere", "elastic-plastic", 1, [](double f) { return rolling(f, "sphere_engine_stiffness_x1"); });
  add("free vibration", "linear, ζ 0", 2, [](double f) { return free_vibration(f, 0); });
  add("free vibration", "linear, ζ 0.1", 2, [](double f) { return free_vibration(f, 0.1); });
  add("free vibration", "linear, ζ 0.5", 2, [](double f) { return free_vibration(f, 0.5); });
  add("tangential spring", "linear slider", 2, [](double f) { return tangential_oscillation(f, 0); });
  add("rolling spring", "elastic-plastic", 2, [](double f) { return rolling_oscillation(f, 0); });
  add("bouncing ball", "linear, e 0.8", 1, [](double f) { return bouncing_ball(f, "linear_1e+04", 0.8); });
  add("bouncing ball", "Hertz, e 0.8", 1, [](double f) { return bouncing_ball(f, "hertz_1.33e+06", 0.8); });
  add("Hertz head-on", "Hertz, e 1", 2, hertz_head_on);
  add("restitution", "linear, e 0.5", 1, [](double f) { return restitution(f, "linear", 0.5, false); });
  add("restitution", "Hertz, e 0.5", 1.25, [](double f) { return restitution(f, "hertz", 0.5, false); });
  add("oblique, gross sliding", "linear slider, e 1", 2, [](double f) { return oblique_impact(f, 1, 8); });
  add("oblique, sticks then slides", "linear slider, e 0.5", 1, [](double f) { return oblique_impact(f, 0.5, 1); });
  add("spin decay, twisting", "elastic-plastic", 1, [](double f) { return spin_decay(f, "torsion_printed"); });
  add("spin decay, rolling", "elastic-plastic", 1, [](double f) { return spin_decay(f, "rolling_frictionless_floor_printed"); });
  return all;
}

}  // namespace acopla::dem::verification
