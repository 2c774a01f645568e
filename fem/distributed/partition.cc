#include "fem/distributed/partition.h"

#include <deal.II/grid/grid_tools.h>
#include <deal.II/lac/dynamic_sparsity_pattern.h>
#include <deal.II/lac/sparsity_pattern.h>
#include <deal.II/lac/sparsity_tools.h>
#include <fmt/format.h>

#include <algorithm>

#include "fem/discretisation.h"
#include "io/error.h"

namespace acopla::fem {
namespace {

/// The process of each cell.
std::vector<unsigned> divide(const Mesh& mesh, int processes) {
  std::vector<unsigned> owners(mesh.cells(), 0);
  with_dimension(mesh.dimension(), [&](auto d) {
    dealii::DynamicSparsityPattern neighbours;
    dealii::GridTools::get_face_connectivity_of_cells(mesh.discretisation<d>().triangulation, neighbours);
    dealii::SparsityPattern graph;
    graph.copy_from(neighbours);
    dealii::SparsityTools::partition(graph, static_cast<unsigned>(processes), owners, dealii::SparsityTools::Partitioner::metis);
  });
  return owners;
}

}  // namespace

Partition::Partition(const Mesh& mesh, Team& team) : order_(mesh.nodes()), places_(mesh.nodes()), starts_(static_cast<std::size_t>(team.size()) + 1, 0) {
  const auto processes = static_cast<std::uint32_t>(team.size());
  std::vector<std::uint32_t> owner(mesh.nodes(), processes);
  if (team.first() && mesh.cells() >= processes) {
    const auto cells = divide(mesh, team.size());
    for (std::size_t c = 0; c < mesh.cells(); ++c)
      for (const auto node : mesh.cell(c)) owner[node] = std::min(owner[node], cells[c]);
  }
  team.send_to_all(owner);  // nothing hangs on METIS giving everybody the same
  for (const auto rank : owner)
    if (rank < processes) ++starts_[rank + 1];
  if (std::any_of(starts_.begin() + 1, starts_.end(), [](auto count) { return count == 0; }))
    throw io::UserError(fmt::format("the mesh \"{}\" of {} cells is too small for {} processes: some would have nothing to do. Use fewer.", mesh.name(),
                                    mesh.cells(), processes));
  for (std::size_t r = 0; r < processes; ++r) starts_[r + 1] += starts_[r];
  auto next = starts_;
  for (std::uint32_t n = 0; n < mesh.nodes(); ++n) {
    places_[n] = static_cast<std::uint32_t>(next[owner[n]]++);
    order_[places_[n]] = n;
  }
}

std::vector<int> Partition::sizes(int dimension) const {
  std::vector<int> result;
  for (std::size_t r = 0; r + 1 < starts_.size(); ++r) result.push_back(dimension * static_cast<int>(starts_[r + 1] - starts_[r]));
  return result;
}

}  // namespace acopla::fem
