// What each point of a surface has in common with the faces of another: face clipped on face.
#pragma once

#include <cstdint>
#include <vector>

#include "coupler/mapping/search.h"
#include "geometry/surface_mesh.h"
#include "io/large_memory.h"

namespace acopla::coupler {

/// The forces on the points of `from` stand for a traction on its faces, which loads the faces of `to` that lie over them (Nasato 2011, §2.6.3, where
/// control surfaces are counted in pixels). Row i holds w_ik = ∫ ψ_i N_k dA / ∫ ψ_i dA, integrated over the polygons in which a face of one covers
/// a face of the other, seen along its normal; N_k are the shape functions of `to`, and ψ_i those of `from` that are dual to its hat functions N_j,
/// ∫ ψ_i N_j dA = δ_ij ∫ N_i dA face by face (Wohlmuth 2000). So Σ_k w_ik x_k is x_i itself on faces that coincide and needs no couple; forces
/// of uniform pressure become those of uniform pressure, whatever the two meshes, and a coarse surface loads all the nodes under it. A face of `from`
/// that is not covered whole takes N_i instead of ψ_i, which is never negative.
///
/// Exact for straight edges: faces of second order of `from` count as the linear ones between all their nodes, curved edges of `to` as two straight ones.
/// Faces take part that turn by less than 60 degrees from each other and are about as far away as the nearest (a thin plate's other side is not).
struct Overlap {
  // Row i of the weights: nodes and weights from starts[i] to starts[i + 1]; empty where nothing of `to` lies over the faces around i.
  std::vector<std::size_t> starts{0};
  std::vector<std::uint32_t, io::LargeMemory<std::uint32_t>> nodes;  ///< of faces over those around the point, each once, also where the weight is zero or round-off
  std::vector<double, io::LargeMemory<double>> weights;  ///< sum 1 in each row
};

/// @param search  of the faces of `to`; @param max_distance  [m] beyond which faces are no partners
Overlap overlap_of(const geometry::SurfaceMesh& from, const geometry::SurfaceMesh& to, const PartnerSearch& search, double max_distance);

}  // namespace acopla::coupler
