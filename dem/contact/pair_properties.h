// What two materials do to each other, before a law picks from it what it needs.
#pragma once

#include <limits>
#include <string>
#include <vector>

#include "io/case_table.h"

namespace acopla::dem {

/// A number that a law of its own takes from the case: declared once; read, checked, documented and explained from here.
struct Field {
  const char* key;
  const char* unit;
  io::Range range;
  double fallback;  ///< `required`, `optional` (then NaN arrives), or the default
  const char* doc;

  static constexpr double required = std::numeric_limits<double>::infinity();
  static constexpr double optional = -std::numeric_limits<double>::infinity();
};

/// Names of the laws of a contact.
struct LawSet {
  std::string normal, tangential = "none", rolling = "none";
  bool operator==(const LawSet&) const = default;
  std::string text() const { return normal + " + " + tangential + " + " + rolling; }
};

/// Properties of a pair of materials. A value that the scene's laws do not use may be left at 0.
struct PairProperties {
  LawSet laws;                  ///< without a normal law the pair never meets
  double modulus = 0;           ///< Y* = 1 / ((1−ν_i²)/E_i + (1−ν_j²)/E_j) [Pa]
  double shear_modulus = 0;     ///< G* = 1 / ((2−ν_i)/G_i + (2−ν_j)/G_j) [Pa]
  double stiffness = 0;         ///< linear normal spring [N/m]; of a user's law its slope at 5 % overlap, for the step
  double hertz_damping = 0;     ///< 2 sqrt(5/6) β
  double damping_ratio = 0;     ///< of the linear spring
  double restitution = 1;
  double friction = 0;
  double rolling_friction = 0;
  /// The laws' own numbers, in the order of their `fields`.
  std::vector<double> normal_values, tangential_values, rolling_values;
};

}  // namespace acopla::dem
