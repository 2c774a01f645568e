// A structure as its case describes it: mesh, materials, supports and loads, before any analysis.
#pragma once

#include "fem/dynamics.h"
#include "fem/elasticity.h"
#include "fem/loads.h"
#include "fem/settings.h"
#include "fem/supports.h"

namespace acopla::fem {

struct Model {
  Mesh mesh;
  Materials materials;
  Supports supports;
  Loads loads;  ///< weight and the loads of the case

  /// Reads the mesh and finds the parts that the case names.
  /// @param gravity  [m/s²]
  /// @throws io::UserError located in the case, also when a static structure is left free to move
  Model(const Settings& settings, const Vec3& gravity);
};

/// Of the body and of the foundations that it stands on [N/m].
BlockMatrix stiffness_of(const Settings& settings, const Model& model);

/// @throws io::UserError at `key` of the structure when its supports leave it free to move
void require_supported(const Settings& settings, const Mesh& mesh, const Fixed& fixed,
                       const std::string& key, const std::string& advice);

}  // namespace acopla::fem
