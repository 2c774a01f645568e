// What one process keeps of a structure's matrices.
#pragma once

#include <map>
#include <memory>
#include <optional>

#include "fem/distributed/partition.h"
#include "fem/model.h"

namespace acopla::fem {

class SharedSystem;

/// The rows of K and M of the nodes of one process, and its part of the systems made of them. All processes call every method at once;
/// whole vectors are those of the first process, others pass null.
class Share {
 public:
  /// Assembles the stiffness. Settings and model must outlive this.
  Share(Team& team, const Settings& settings, const Model& model);
  ~Share();

  void assemble_mass();
  double norm();  ///< largest sum of magnitudes of a row of K
  enum class Matrix : int { stiffness, mass };
  void multiply(Matrix matrix, const Vector* x, Vector* result);
  /// Makes the system k K + m M and its preconditioner, under a name.
  void prepare(std::int64_t id, double k, double m, double tolerance);
  void drop(std::int64_t id);
  void solve(std::int64_t id, const Vector* f, Vector* u);

 private:
  /// Rows of this process, from nodal vectors of the first and back.
  void scatter(const Vector* whole, Vector& part);
  void gather(const Vector& part, Vector* whole);

  Team& team_;
  const Settings& settings_;
  const Model& model_;
  Partition partition_;
  std::vector<int> sizes_;
  std::optional<BlockMatrix> stiffness_;
  std::optional<MassMatrix> mass_;
  std::map<std::int64_t, std::unique_ptr<SharedSystem>> systems_;
};

}  // namespace acopla::fem
