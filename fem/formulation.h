// How a structure's kinematics are simplified and its cells integrated.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "fem/material.h"

namespace acopla::fem {

struct Formulation {
  enum class Plane { strain, stress };  ///< of a structure in 2D
  /// Against locking: `b_bar` averages the volumetric strain of a cell (Hughes 1980): to its mean
  /// in first-order cells, to its linear part in those of second order.
  enum class Locking { untreated, b_bar };
  Plane plane = Plane::strain;
  double thickness = 1;  ///< [m] of a structure in 2D
  Locking locking = Locking::untreated;
  bool large = false;  ///< displacements: stresses are then those of the deformed body

  /// λ [Pa] of the strains that the kinematics leave: in plane stress ε_zz follows from σ_zz = 0,
  /// so that λ' = 2 λ μ / (λ + 2 μ).
  double lambda(const Material& material, int dimension) const {
    const double lambda = material.lambda(), mu = material.mu();
    return dimension == 2 && plane == Plane::stress ? 2 * lambda * mu / (lambda + 2 * mu) : lambda;
  }
};

/// The material of each cell.
class Materials {
 public:
  Materials(const Material& everywhere) : list_{everywhere} {}
  /// @param of_cell  index into `list`, one a cell
  Materials(std::vector<Material> list, std::vector<std::uint16_t> of_cell)
      : list_(std::move(list)), of_cell_(std::move(of_cell)) {}

  const Material& of(std::size_t cell) const {
    return of_cell_.empty() ? list_.front() : list_[of_cell_[cell]];
  }
  const std::vector<Material>& list() const { return list_; }

 private:
  std::vector<Material> list_;
  std::vector<std::uint16_t> of_cell_;
};

}  // namespace acopla::fem
