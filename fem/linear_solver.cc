#include "fem/linear_solver.h"

#include <fmt/format.h>

#include "fem/cholesky.h"

namespace acopla::fem {
namespace {

class Direct : public LinearSolver {
 public:
  Direct(Cholesky cholesky, const Mesh& mesh) : cholesky_(std::move(cholesky)), mesh_(mesh) {}
  void prepare() override { cholesky_.factor(mesh_.points()); }
  void solve(const Vector& f, Vector& u) override { cholesky_.solve(f, u); }

 private:
  Cholesky cholesky_;
  const Mesh& mesh_;
};

std::string gibibytes(double bytes) { return fmt::format("{:.2g} GiB", bytes / (1ull << 30)); }

}  // namespace

ChosenSolver choose_solver(const BlockMatrix& matrix, const Mesh& mesh, const Fixed& fixed,
                           const SolverOptions& options) {
  using Kind = SolverOptions::Kind;
  ChosenSolver chosen;
  const auto iterate = [&] {
    chosen.direct = false;
    chosen.solver = make_conjugate_gradients(matrix, mesh, fixed, options.tolerance);
  };
  if (options.kind == Kind::cg) {
    iterate();
    chosen.why = "the case asks for it";
    return chosen;
  }
  Cholesky cholesky(matrix, fixed);
  chosen.factor_bytes = cholesky.bytes();
  chosen.flops = cholesky.flops();
  const bool fits = chosen.factor_bytes <= options.memory_limit;
  if (options.kind == Kind::automatic)
    chosen.why =
        fmt::format("its factor of {} is {} the memory limit of {}", gibibytes(chosen.factor_bytes),
                    fits ? "within" : "above", gibibytes(options.memory_limit));
  else
    chosen.why = "the case asks for it";
  if (fits || options.kind == Kind::direct)
    chosen.solver = std::make_unique<Direct>(std::move(cholesky), mesh);
  else
    iterate();
  return chosen;
}

}  // namespace acopla::fem
