#include "fem/dynamics.h"

#include <fmt/format.h>

#include <stdexcept>

#include "fem/condition.h"

namespace acopla::fem {

Scheme Scheme::newmark(double beta, double gamma) {
  if (gamma < 0.5)
    throw std::invalid_argument(fmt::format(
        "has gamma = {:.6g}: below 1/2 every step feeds energy in. Use 0.5, or more to damp.",
        gamma));
  if (2 * beta < gamma)
    throw std::invalid_argument(
        fmt::format("has beta = {:.6g} below gamma / 2 = {:.6g}: stable for short steps only. "
                    "Newmark's method is stable at every "
                    "step where 2 beta >= gamma >= 1/2; use beta = 0.25, gamma = 0.5.",
                    beta, gamma / 2));
  return {.beta = beta, .gamma = gamma};
}

Scheme Scheme::generalised_alpha(double spectral_radius) {
  const double r = spectral_radius;  // Chung & Hulbert (1993), eq. 25, 17, 20
  const double alpha_m = (2 * r - 1) / (r + 1), alpha_f = r / (r + 1);
  const double gamma = 0.5 - alpha_m + alpha_f, root = 1 - alpha_m + alpha_f;
  return {.beta = 0.25 * root * root,
          .gamma = gamma,
          .alpha_m = alpha_m,
          .alpha_f = alpha_f,
          .generalised = true};
}

Dynamics::Dynamics(const Mesh& mesh, const BlockMatrix& stiffness, const MassMatrix& mass,
                   const Rayleigh& damping, const Supports& supports, const Loads& loads,
                   const Scheme& scheme, const SolverOptions& options)
    : Dynamics(mesh, std::make_shared<LocalMatrices>(mesh, supports.fixed(), stiffness, &mass), damping, supports, loads, scheme, options) {}

Dynamics::Dynamics(const Mesh& mesh, std::shared_ptr<const Matrices> matrices, const Rayleigh& damping, const Supports& supports,
                   const Loads& loads, const Scheme& scheme, const SolverOptions& options)
    : mesh_(mesh),
      matrices_(std::move(matrices)),
      damping_(damping),
      supports_(supports),
      loads_(loads),
      scheme_(scheme),
      options_(options),
      held_nodes_(supports.nodes()) {}

void Dynamics::prepare(double step) {
  if (step == step_) return;
  step_ = step;
  // (1 − α_m) M / (β Δt²) + (1 − α_f) (γ C / (β Δt) + K): of the unknown u₁ − u₀.
  const double b = scheme_.beta * step, f = 1 - scheme_.alpha_f;
  const double m = (1 - scheme_.alpha_m) / (b * step) + f * scheme_.gamma / b * damping_.mass;
  const double k = f * (1 + scheme_.gamma / b * damping_.stiffness);
  of_stiffness_ = k;
  of_mass_ = m;
  effective_ = {};  // before the next is made
  effective_ = matrices_->solver(k, m, options_);
  effective_.solver->prepare();
  ++factorisations_;
  if (effective_.direct) effective_.matrix.reset();  // the factor is all that is needed
  if (scheme_.average_acceleration() || mass_solver_.solver) return;
  mass_solver_ = matrices_->solver(0, 1, options_);
  mass_solver_.solver->prepare();
  if (mass_solver_.direct) mass_solver_.matrix.reset();
}

double Dynamics::condition() const {
  Vector product;
  return condition_number(
      [&](const Vector& x, Vector& result) {
        matrices_->stiffness(of_stiffness_ * x, result);
        matrices_->mass(of_mass_ * x, product);
        result += product;
      },
      [&](const Vector& x, Vector& result) {
        result.resize(0);
        effective_.solver->solve(x, result);
      },
      supports_.fixed());
}

/// Accelerations at the window's start: of free unknowns from M a = F̄ − K u − C v, of held ones as
/// prescribed.
void Dynamics::begin(Motion& motion, const Vector& mean_force) {
  if (scheme_.average_acceleration()) return;
  if (scheme_.generalised && motion.acceleration.size() > 0) {
    Vector jump;
    mass_solver_.solver->solve(mean_force - motion.force, jump);
    motion.acceleration += jump;
  } else {
    Vector held = mesh_.zero();
    supports_.accelerate(motion.time, held);
    matrices_->stiffness(motion.displacement + damping_.stiffness * motion.velocity, K_x_);
    matrices_->mass(damping_.mass * motion.velocity + held, M_x_);
    mass_solver_.solver->solve(mean_force + loads_.at(motion.time) - K_x_ - M_x_,
                               motion.acceleration);
    motion.acceleration += held;
  }
  motion.force = mean_force;
}

/// S Δu = 2 (F − K u₀) + (4/Δt) M v₀ at free unknowns, S = (4/Δt²) M + (2/Δt) C + K: the midpoint
/// rule with v₁ = 2 Δu/Δt − v₀. Held unknowns bring their own Δu_p and v₁: (2/Δt) M (v₁ − v₀) +
/// ((2/Δt) C + K) Δu_p.
void Dynamics::midpoint_step(Motion& motion, const Vector& mean_force, double step) {
  auto& u = motion.displacement;
  auto& v = motion.velocity;
  const double end = motion.time + step;
  K_arg_ = 2 * u;
  M_arg_ = 4 / step * v;
  if (supports_.moving()) {
    held_ = u;
    speed_ = v;
    supports_.place(end, held_);
    supports_.drive(end, speed_);
    held_ -= u;  // Δu_p, and 0 at free unknowns
    K_arg_ += (1 + 2 / step * damping_.stiffness) * held_;
    for (Eigen::Index i = 0; i < u.size(); ++i)
      if (supports_.fixed()[static_cast<std::size_t>(i)]) M_arg_[i] = 2 / step * (v[i] - speed_[i]);
    M_arg_ -= 2 / step * damping_.mass * held_;
  }
  matrices_->stiffness(K_arg_, K_x_);
  matrices_->mass(M_arg_, M_x_);
  right_ = 2 * (mean_force + loads_.mean(motion.time, end)) - K_x_ + M_x_;
  if (!effective_.direct) change_ = step * v;
  effective_.solver->solve(right_, change_);
  u += change_;
  v = 2 / step * change_ - v;
  if (supports_.moving()) u += held_;
  supports_.drive(end, v);
  motion.time = end;
}

/// Newmark (1959) for the unknown Δu; with α_m, α_f the equation holds between the ends of the step
/// (Chung & Hulbert 1993).
void Dynamics::newmark_step(Motion& motion, const Vector& mean_force, double step) {
  auto& u = motion.displacement;
  auto& v = motion.velocity;
  auto& a = motion.acceleration;
  const auto& [beta, gamma, am, af, generalised] = scheme_;
  const double end = motion.time + step;
  // What the step ends in where Δu = 0, and as prescribed at held unknowns.
  Vector u1 = u, v1 = (1 - gamma / beta) * v + step * (1 - gamma / (2 * beta)) * a;
  Vector a1 = -1 / (beta * step) * v - (1 / (2 * beta) - 1) * a;
  if (supports_.moving()) {
    supports_.place(end, u1);
    speed_ = v;
    supports_.drive(end, speed_);
    for (Eigen::Index i = 0; i < u.size(); ++i)
      if (supports_.fixed()[static_cast<std::size_t>(i)]) {
        v1[i] = speed_[i];
        a1[i] = (speed_[i] - v[i]) / step;
      }
  }
  const Vector rate = (1 - af) * v1 + af * v;
  matrices_->stiffness((1 - af) * u1 + af * u + damping_.stiffness * rate, K_x_);
  matrices_->mass((1 - am) * a1 + am * a + damping_.mass * rate, M_x_);
  right_ = mean_force + (1 - af) * loads_.at(end) + af * loads_.at(motion.time) - K_x_ - M_x_;
  if (!effective_.direct) change_ = step * v;
  effective_.solver->solve(right_, change_);
  u = u1 + change_;
  v = v1 + gamma / (beta * step) * change_;
  a = a1 + 1 / (beta * step * step) * change_;
  motion.time = end;
}

Vector Dynamics::advance(Motion& motion, const Vector& mean_force, double length, int steps,
                         Energy* energy) {
  const double step = length / steps, start = motion.time;
  prepare(step);
  begin(motion, mean_force);
  const Vector u0 = motion.displacement, v0 = motion.velocity;
  Vector mean_displacement = 0.5 * u0;
  if (energy) *energy = {};
  for (int k = 0; k < steps; ++k) {
    motion.time = start + k * step;  // no sum of rounded steps
    Vector before_u, before_v;
    if (energy) {
      before_u = motion.displacement;
      before_v = motion.velocity;
    }
    scheme_.average_acceleration() ? midpoint_step(motion, mean_force, step)
                                   : newmark_step(motion, mean_force, step);
    if (energy) add_exchange(before_u, before_v, motion, mean_force, step, *energy);
    mean_displacement += (k + 1 < steps ? 1.0 : 0.5) * motion.displacement;
  }
  motion.time = start + length;
  mean_displacement /= steps;
  if (energy) {
    const auto now = this->energy(motion);
    energy->kinetic = now.kinetic;
    energy->strain = now.strain;
  }
  return reactions(u0, v0, mean_displacement, motion,
                   mean_force + loads_.mean(start, start + length), length);
}

/// M (v₁ − v₀)/T + C (u₁ − u₀)/T + K ū − f at held unknowns: what the supports gave the body in the
/// time T.
Vector Dynamics::reactions(const Vector& u0, const Vector& v0, const Vector& mean_u,
                           const Motion& end, const Vector& load, double length) const {
  Vector result = mesh_.zero();
  if (held_nodes_.empty()) return result;
  const Vector rate = (end.displacement - u0) / length;
  Vector product = result;
  matrices_->stiffness(mean_u + damping_.stiffness * rate, held_nodes_, result);
  matrices_->mass((end.velocity - v0) / length + damping_.mass * rate, held_nodes_, product);
  result += product - load;
  for (Eigen::Index i = 0; i < result.size(); ++i)
    if (!supports_.fixed()[static_cast<std::size_t>(i)]) result[i] = 0;
  return result;
}

void Dynamics::add_exchange(const Vector& u0, const Vector& v0, const Motion& end,
                            const Vector& mean_force, double step, Energy& energy) const {
  const Vector change = end.displacement - u0;
  const Vector load = mean_force + loads_.mean(end.time - step, end.time);
  energy.work += load.dot(change);
  Vector product;
  if (damping_.mass != 0) {
    matrices_->mass(change, product);
    energy.damping += damping_.mass / step * change.dot(product);
  }
  if (damping_.stiffness != 0) {
    matrices_->stiffness(change, product);
    energy.damping += damping_.stiffness / step * change.dot(product);
  }
  if (supports_.moving())
    energy.support_work +=
        reactions(u0, v0, 0.5 * (u0 + end.displacement), end, load, step).dot(change);
}

Energy Dynamics::energy(const Motion& motion) const {
  Vector product;
  Energy result;
  matrices_->mass(motion.velocity, product);
  result.kinetic = 0.5 * motion.velocity.dot(product);
  matrices_->stiffness(motion.displacement, product);
  result.strain = 0.5 * motion.displacement.dot(product);
  return result;
}

}  // namespace acopla::fem
