// The elastic material of a structure.
#pragma once

#include <optional>

namespace acopla::fem {

/// Isotropic elasticity: σ = λ tr(ε) I + 2 μ ε under small displacements, `law` under large ones.
struct Material {
  enum class Law { st_venant_kirchhoff, neo_hooke };
  double young = 0;               ///< E [Pa] > 0
  double poisson = 0;             ///< ν in (-1, 0.5)
  std::optional<double> density;  ///< ρ [kg/m³]; a structure without one has no weight
  Law law = Law::st_venant_kirchhoff;

  double lambda() const { return young * poisson / ((1 + poisson) * (1 - 2 * poisson)); }  ///< [Pa]
  double mu() const { return young / (2 * (1 + poisson)); }                                ///< [Pa]
};

}  // namespace acopla::fem
