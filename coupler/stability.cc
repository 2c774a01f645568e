#include "coupler/stability.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace acopla::coupler {

using geometry::Vec3;

namespace {

/// How m ÿ + c ẏ + k y = 0 goes on for a time: (y, ẏ) at its end from (y, ẏ) at its start.
Eigen::Matrix2d swing(double stiffness, double dashpot, double mass, double time) {
  const double decay = dashpot / (2 * mass), square = stiffness / mass - decay * decay;
  const double angle = std::sqrt(std::abs(square)) * time;
  double cosine = 0, sine = 0;  // times exp(−decay · time), and the latter over the root of `square`
  if (angle < 1e-4) {  // critical damping, where the difference of two exponentials would leave few digits
    const double turn = square * time * time, faded = std::exp(-decay * time);
    cosine = faded * (1 - turn / 2);
    sine = faded * time * (1 - turn / 6);
  } else if (square > 0) {
    const double faded = std::exp(-decay * time);
    cosine = faded * std::cos(angle);
    sine = faded * std::sin(angle) * time / angle;
  } else {  // the growth of cosh and sinh is less than the decay
    const double slow = std::exp(angle - decay * time), fast = std::exp(-angle - decay * time);
    cosine = 0.5 * (slow + fast);
    sine = 0.5 * (slow - fast) * time / angle;
  }
  Eigen::Matrix2d result;
  result << cosine + decay * sine, sine, -stiffness / mass * sine, cosine - decay * sine;
  return result;
}

}  // namespace

double growth_of_free_particle(const Touch& touch, double length) {
  const double share = touch.particle / touch.node;
  const auto swung = swing(touch.stiffness, touch.dashpot, touch.particle, length);
  // Distance and speed apart at the next window's start: the node was pushed by J = −m (ẏ₁ − ẏ₀), by the midpoint rule.
  Eigen::Matrix2d window = swung;
  const Eigen::RowVector2d change = swung.row(1) - Eigen::RowVector2d(0, 1);
  window.row(0) += 0.5 * share * length * change;
  window.row(1) += share * change;
  return window.eigenvalues().cwiseAbs().maxCoeff() - 1;
}

double growth_of_held_particle(const Touch& touch, double length) {
  const auto& [k, c, m, node] = touch;
  // With s the surface's place, x = s/2 + y, m ÿ + 2 c ẏ + 2 k y = 0, and the node is pushed by J = −m (ẏ₁ − ẏ₀)/2 − ∫ (k s + c ṡ)/2 dt.
  const auto swung = swing(2 * k, 2 * c, m, length);
  Eigen::RowVector4d push;  // J/M of (s, ṡ, y, ẏ) at the window's start
  push << -0.5 * k * length, -0.5 * (0.5 * k * length + c) * length, -0.5 * m * swung(1, 0), -0.5 * m * (swung(1, 1) - 1);
  push /= node;
  Eigen::Matrix4d window = Eigen::Matrix4d::Identity();
  window(0, 1) = length;
  window.row(0) += 0.5 * length * push;
  window.row(1) += push;
  window.block<2, 2>(2, 2) = swung;
  // The surface begins the next window elsewhere than it went: y is counted from there.
  window.row(2) -= 0.25 * length * push;
  window.row(3) -= 0.5 * push;
  return window.eigenvalues().cwiseAbs().maxCoeff() - 1;
}

double explicit_growth(const Touch& touch, double length) {
  return std::max(growth_of_free_particle(touch, length), growth_of_held_particle(touch, length));
}

Stability::Stability(const Crew& crew, const Account& account) : account_(account) {
  for (const auto& link : account_.links()) {
    if (!link.mapping) continue;
    const auto& mass = crew.initial(link.about->to).mass;
    if (!mass.empty()) nodes_[link.about->to.text()].mass = mass;
  }
}

void Stability::measure(const std::map<std::string, protocol::Advance>& answers) {
  held_ = false;
  for (auto& [to, nodes] : nodes_) {
    const auto count = nodes.mass.size();
    for (auto* sums : {&nodes.stiffness, &nodes.dashpot, &nodes.touching}) sums->assign(count, Vec3::Zero());
    std::vector<Vec3> part(count);
    for (const auto& link : account_.links()) {
      if (!link.mapping || link.about->to.text() != to) continue;
      const auto answer = answers.find(link.about->from.participant);
      if (answer == answers.end()) continue;
      for (const auto& field : answer->second.fields) {
        if (field.surface != link.about->from.surface) continue;
        auto* sums = field.name == "stiffness" ? &nodes.stiffness : field.name == "dashpot" ? &nodes.dashpot : field.name == "mass" ? &nodes.touching : nullptr;
        if (!sums) continue;
        link.mapping->shares(field.values, part);
        for (std::size_t k = 0; k < count; ++k) (*sums)[k] += part[k];
      }
    }
    held_ = held_ || std::any_of(nodes.stiffness.begin(), nodes.stiffness.end(), [](const Vec3& k) { return k[0] > 0; });
  }
}

Stability::Worst Stability::worst(double length) const {
  Worst worst;
  double square = 0, lightest = 0;
  Touch stiff, light;  // the largest hold, and the stiffest contact with the lightest particles
  for (const auto& [surface, nodes] : nodes_)
    for (std::size_t n = 0; n < nodes.stiffness.size(); ++n) {
      Touch touch{nodes.stiffness[n][0], nodes.dashpot[n][0], nodes.touching[n][0], 0};
      if (!(touch.stiffness > 0) && !(touch.dashpot > 0)) continue;
      for (const double mass : nodes.mass[n]) {
        if (!(mass > 0)) continue;
        touch.node = mass;
        if (const double swift = touch.stiffness * touch.stiffness / (mass * touch.particle); touch.particle > 0 && swift > lightest) {
          lightest = swift;
          light = touch;
        }
        const double hold = length * (touch.stiffness * length + 2 * touch.dashpot) / mass;
        if (!(hold > square)) continue;
        square = hold;
        stiff = touch;
        worst.surface = surface;
        worst.node = n;
      }
    }
  worst.ratio = std::sqrt(square);
  for (const auto& touch : {stiff, light})
    if (touch.particle > 0) worst.growth = std::max(worst.growth, explicit_growth(touch, length));
  return worst;
}

double Stability::mass_at(const Worst& worst) const { return nodes_.at(worst.surface).mass[worst.node].maxCoeff(); }

}  // namespace acopla::coupler
