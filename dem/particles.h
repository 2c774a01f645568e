// The particles: a structure of arrays of four-double records, so that one load brings what a contact needs.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "dem/contact/vector.h"

namespace acopla::dem {

/// Three components and one scalar that is needed together with them.
struct alignas(32) Record {
  double x = 0, y = 0, z = 0, w = 0;
  Vec3 vector() const { return {x, y, z}; }
  void set(const Vec3& v) {
    x = v[0];
    y = v[1];
    z = v[2];
  }
  void add(const Vec3& v) {
    x += v[0];
    y += v[1];
    z += v[2];
  }
};

/// What a scene's particles store. Where no law turns them, nothing of rotation is kept.
struct ParticleKind {
  int dimension = 3;    ///< 2: discs of unit depth; 3: spheres
  bool rotates = true;  ///< the scene's laws have friction or rolling resistance
};

/// Spheres, or discs of unit depth. All arrays have one entry a particle, in the order of the present sorting; `id` keeps their
/// names. Discs keep their spin in the third component of `velocity` and their torque in that of `force`; spheres that rotate have
/// arrays of their own for them. Ask spin_of() and velocity_of() instead of knowing that.
struct Particles {
  ParticleKind kind;
  std::vector<Record> position;        ///< [m]; w: radius [m]
  std::vector<Record> velocity;        ///< [m/s]; w: mass [kg]. Of the last half step while forces are summed, of the whole step between windows
  std::vector<Record> spin;            ///< [rad/s]; w: moment of inertia [kg m²]; spheres that rotate only
  std::vector<Record> force;           ///< contact force [N]
  std::vector<Record> torque;          ///< about the centre [N m]; spheres that rotate only
  std::vector<std::uint32_t> id;
  std::vector<std::uint8_t> material;

  bool has_spins() const { return kind.dimension == 3 && kind.rotates; }
  std::size_t size() const { return id.size(); }
  /// Adds a particle whose id is `next_id`, which grows by one.
  void add(const Vec3& at, double radius, double density, std::uint8_t of_material, const Vec3& with_velocity,
           const Vec3& with_spin = Vec3::Zero());
  /// Reorders everything: entry k becomes the former entry order[k]; `order` may leave particles out.
  void reorder(const std::vector<std::uint32_t>& order);

  Vec3 velocity_of(std::size_t i) const {
    return kind.dimension == 3 ? velocity[i].vector() : Vec3(velocity[i].x, velocity[i].y, 0);
  }
  Vec3 spin_of(std::size_t i) const {
    if (kind.dimension == 2) return {0, 0, velocity[i].z};
    return kind.rotates ? spin[i].vector() : Vec3::Zero();
  }
  void set_spin(std::size_t i, const Vec3& value);
  double radius_of(std::size_t i) const { return position[i].w; }
  double mass_of(std::size_t i) const { return velocity[i].w; }
  /// m r²/2 of a disc, 2 m r²/5 of a sphere [kg m²]
  double inertia_of(std::size_t i) const { return (kind.dimension == 2 ? 0.5 : 0.4) * mass_of(i) * radius_of(i) * radius_of(i); }

  /// Bytes a particle in the arrays above.
  std::size_t bytes_each() const { return (has_spins() ? 5 : 3) * sizeof(Record) + sizeof(std::uint32_t) + sizeof(std::uint8_t); }

  template <class Archive>
  void state(Archive& archive) {
    archive("position", position);
    archive("velocity", velocity);
    archive("spin", spin);
    archive("force", force);
    archive("torque", torque);
    archive("id", id);
    archive("material", material);
    archive("next_id", next_id);
  }

  std::uint32_t next_id = 0;  ///< ids are never used twice
};

/// Volume of a sphere [m³], or of a disc of unit depth [m³/m].
double volume_of(int dimension, double radius);

}  // namespace acopla::dem
