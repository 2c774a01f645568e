// The particles: a structure of arrays of four-double records, so that one load brings what a contact needs.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "dem/contact/vector3.h"

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

/// Spheres. All arrays have one entry a particle, in the order of the present sorting; `id` keeps their names. The three
/// arrays of rotation are empty where the scene's laws have neither friction nor rolling resistance.
struct Particles {
  bool rotates = true;
  std::vector<Record> position;              ///< [m]; w: radius [m]
  std::vector<Record> velocity;              ///< [m/s]; w: mass [kg]. Predicted to the step's end while forces are summed
  std::vector<Record> spin;                  ///< [rad/s]; w: moment of inertia [kg m²]
  std::vector<Record> force;                 ///< contact force [N]
  std::vector<Record> torque;                ///< about the centre [N m]
  std::vector<Record> acceleration;          ///< of the last completed step [m/s²]
  std::vector<Record> angular_acceleration;  ///< [rad/s²]
  std::vector<std::uint32_t> id;
  std::vector<std::uint8_t> material;

  std::size_t size() const { return id.size(); }
  void add(const Vec3& at, double radius, double density, std::uint8_t of_material, const Vec3& with_velocity);
  /// Reorders everything: entry k becomes the former entry order[k].
  void reorder(const std::vector<std::uint32_t>& order);

  std::size_t bytes_each() const {
    return (rotates ? 7 : 4) * sizeof(Record) + sizeof(std::uint32_t) + sizeof(std::uint8_t);
  }
};

}  // namespace acopla::dem
