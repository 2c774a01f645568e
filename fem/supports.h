// Which displacements are held or prescribed, and whether that is enough.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "fem/amplitude.h"
#include "fem/mesh.h"

namespace acopla::fem {

/// One mark an unknown (d n + c): 1 where direction c of node n is held at zero or at a prescribed
/// value.
using Fixed = std::vector<char>;

/// Marks the nodes of faces in the directions given.
void hold(const std::vector<BoundaryFace>& faces, const std::array<bool, 3>& directions,
          Fixed& fixed, int dimension = 3);

/// Held and moved unknowns of a structure.
class Supports {
 public:
  explicit Supports(const Mesh& mesh)
      : dimension_(mesh.dimension()), fixed_(mesh.unknowns(), 0), owner_(mesh.unknowns(), -1) {}

  /// Holds nodes in the directions marked at zero.
  /// @param name  of the table, for messages
  /// @throws std::invalid_argument, whose text continues that name, when another support moves them
  void hold(const std::string& name, const Mesh& mesh, const std::vector<std::uint32_t>& nodes,
            const std::array<bool, 3>& directions);
  /// Moves nodes by value · history. @param value  [m], or [m/s], [m/s²] for a history of velocities or accelerations
  /// @throws std::invalid_argument as hold
  void move(const std::string& name, const Mesh& mesh, const std::vector<std::uint32_t>& nodes,
            const std::array<bool, 3>& directions, const Vec3& value, const MotionHistory& history);

  const Fixed& fixed() const { return fixed_; }
  bool moving() const { return !moved_.empty(); }
  /// Nodes with a held direction, ascending.
  std::vector<std::uint32_t> nodes() const;
  /// Writes displacements [m] at time t into held unknowns.
  void place(double time, Vector& displacement) const;
  /// Writes velocities [m/s] into held unknowns.
  void drive(double time, Vector& velocity) const;
  /// Writes accelerations [m/s²] into held unknowns.
  void accelerate(double time, Vector& acceleration) const;

 private:
  struct Source {
    std::string name;
    bool moves = false;
    Vec3 value = Vec3::Zero();
    MotionHistory history;
  };
  struct Moved {
    std::size_t unknown;
    double value;
    std::size_t source;
  };
  template <class Value>
  void write(const Value& value_of, Vector& nodal) const;
  void claim(const Mesh& mesh, std::uint32_t node, int direction);

  int dimension_;
  Fixed fixed_;
  std::vector<std::int32_t> owner_;  // index into sources_ of each unknown, −1 for free ones
  std::vector<Source> sources_;
  std::vector<Moved> moved_;
};

/// Names the rigid-body motions that the supports leave free, per connected part of the mesh: the
/// null space of the held rows of the rigid modes.
/// @return empty when all parts are held, else e.g. "move along z, turn about the axis along x
/// through (0, 0, 0.5)"
std::string free_motions(const Mesh& mesh, const Fixed& fixed);

}  // namespace acopla::fem
