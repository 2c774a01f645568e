// Scenes of the verification: one material, its law with itself, a few bodies, walls. Built from case text, as a user's would be.
#pragma once

#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "dem/engine.h"

namespace acopla::dem::verification {

inline constexpr double standard_gravity = 9.81;  ///< of reference.json [m/s²]

/// What a case would say; numbers in SI units.
struct OneMaterial {
  int dimension = 3;
  Vec3 gravity = Vec3::Zero();
  double density = 2500, radius = 0.01;     ///< of the particles that the critical step is for
  double shear_modulus = 0, poisson = 0;    ///< 0: the laws need none
  std::string normal, tangential = "\"none\"", rolling = "\"none\"";
  double restitution = 1, friction = 0, rolling_friction = 0;
  bool paper = false;                       ///< the papers' printed damping formula
  std::string more;                         ///< further lines of the participant's table
};
Scene scene_of(const OneMaterial& setup);

/// Law entries of a case.
std::string linear(double stiffness);
/// @param damping_ratio  c_t over 2 sqrt(k_t m*); NaN: that of the normal dashpot
std::string linear_slider(double ratio, double damping_ratio);
std::string elastic_plastic(double damping_ratio, double stiffness_factor = 1, double twisting = 0);

struct Body {
  Vec3 at;
  double radius;
  Vec3 velocity = Vec3::Zero(), spin = Vec3::Zero();
  double density = 0;  ///< 0: the scene's
};
std::unique_ptr<Engine> engine_of(const Scene& scene, const std::vector<Body>& bodies, std::vector<Wall> walls = {});

Wall plane(const Vec3& point, const Vec3& normal);
Wall mesh(std::vector<Vec3> points, std::vector<std::array<std::uint32_t, 3>> triangles);
Wall line(std::vector<Vec3> corners);

/// Of a particle by its id: the engine sorts.
Vec3 position(const Engine& engine, std::uint32_t id = 0);
Vec3 velocity(const Engine& engine, std::uint32_t id = 0);
Vec3 spin(const Engine& engine, std::uint32_t id = 0);
double mass(const Engine& engine, std::uint32_t id = 0);

/// reference.json
const nlohmann::json& reference();

}  // namespace acopla::dem::verification
