// Pictures of a structure for ParaView.
#pragma once

#include <string>

#include "fem/mesh.h"
#include "fem/nodal.h"

namespace acopla::fem {

/// Writes the mesh with "displacement" [m] and "von_mises" [Pa] at its nodes as one .vtu file;
/// cells of second order are drawn as their eight linear parts.
/// @throws io::UserError when the file cannot be written
void write_picture(const std::string& path, const Mesh& mesh, const Vector& displacement,
                   const Vector& von_mises);

}  // namespace acopla::fem
