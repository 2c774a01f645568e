// Which process keeps the rows of which nodes.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "fem/distributed/team.h"
#include "fem/mesh.h"

namespace acopla::fem {

/// Nodes numbered anew, so that those of a process follow one another: cells are divided by METIS into parts of equal size that touch
/// little, and a node goes to the first process among those of its cells.
class Partition {
 public:
  /// By all processes of the team at once. @throws io::UserError when there are fewer nodes or cells than processes can share
  Partition(const Mesh& mesh, Team& team);

  /// Nodes of a process, ascending.
  std::span<const std::uint32_t> nodes(int rank) const {
    const auto r = static_cast<std::size_t>(rank);
    return {order_.data() + starts_[r], order_.data() + starts_[r + 1]};
  }
  const std::vector<std::uint32_t>& order() const { return order_; }  ///< the mesh's number of each node
  std::uint32_t place(std::uint32_t node) const { return places_[node]; }  ///< the number here of the mesh's node
  std::size_t start(int rank) const { return starts_[static_cast<std::size_t>(rank)]; }
  /// Unknowns of each process.
  std::vector<int> sizes(int dimension) const;

 private:
  std::vector<std::uint32_t> order_, places_;
  std::vector<std::size_t> starts_;
};

}  // namespace acopla::fem
