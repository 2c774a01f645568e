// STL triangle files, ASCII and binary.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "geometry/surface_mesh.h"

namespace acopla::io {

/// A triangle surface with shared vertices.
struct TriangleMesh {
  std::vector<geometry::Vec3> points;                     ///< [m]
  std::vector<std::array<std::uint32_t, 3>> triangles;    ///< indices into points, in the order of the file
  std::size_t dropped = 0;                                ///< degenerate triangles of the file that were left out

  geometry::SurfaceMesh surface() const;
};

/// Reads an STL file and welds equal vertices (bitwise equal after reading; STL stores them once a triangle). Triangles
/// whose height is below 1e-9 of their longest edge are dropped and counted.
/// @throws UserError for a file that is missing, empty, truncated, not STL, or without a triangle left
TriangleMesh read_stl(const std::string& path);

/// Writes binary STL (single precision, as the format has it).
void write_stl(const std::string& path, const TriangleMesh& mesh);

}  // namespace acopla::io
