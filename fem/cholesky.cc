#include "fem/cholesky.h"

#include <cholmod.h>
#include <fmt/format.h>

#include <stdexcept>
#include <utility>

#include "fem/supernodal.h"
#include "io/error.h"

namespace acopla::fem {
namespace {

using Index = SuiteSparse_long;

[[noreturn]] void out_of_memory(const std::string& purpose) {
  throw std::runtime_error("not enough memory to " + purpose + " the structure's stiffness");
}

/// Unknowns that are not held, in order, and the inverse map (−1 for a held one).
struct FreeUnknowns {
  std::vector<std::size_t> unknowns;
  std::vector<Index> positions;
  explicit FreeUnknowns(const Fixed& fixed) : positions(fixed.size(), -1) {
    for (std::size_t i = 0; i < fixed.size(); ++i) {
      if (fixed[i]) continue;
      positions[i] = std::ssize(unknowns);
      unknowns.push_back(i);
    }
  }
};

/// The pattern of a symmetric matrix's lower triangle by columns.
/// @param visit  visit(j, f) calls f(i) for the entries of column j, above the diagonal too
template <class Visit>
cholmod_sparse* lower_pattern(std::size_t columns, const Visit& visit, cholmod_common& common) {
  std::size_t entries = 0;
  for (std::size_t j = 0; j < columns; ++j)
    visit(j, [&](Index i) { entries += i >= static_cast<Index>(j); });
  auto* result =
      cholmod_l_allocate_sparse(columns, columns, entries, 1, 1, -1, CHOLMOD_PATTERN, &common);
  if (!result) out_of_memory("analyse");
  auto* starts = static_cast<Index*>(result->p);
  auto* rows = static_cast<Index*>(result->i);
  Index next = 0;
  for (std::size_t j = 0; j < columns; ++j) {
    starts[j] = next;
    visit(j, [&](Index i) {
      if (i >= static_cast<Index>(j)) rows[next++] = i;
    });
  }
  starts[columns] = next;
  return result;
}

}  // namespace

struct Cholesky::State {
  const BlockMatrix& matrix;
  FreeUnknowns free;
  cholmod_common common{};
  cholmod_factor* factor = nullptr;
  cholmod_dense *b = nullptr, *x = nullptr, *work_y = nullptr, *work_e = nullptr;
  double flops = 0;

  State(const BlockMatrix& matrix_, const Fixed& fixed) : matrix(matrix_), free(fixed) {
    cholmod_l_start(&common);
    common.print = 0;
  }
  State(const State&) = delete;
  ~State() {
    for (auto** dense : {&b, &x, &work_y, &work_e}) cholmod_l_free_dense(dense, &common);
    cholmod_l_free_factor(&factor, &common);
    cholmod_l_finish(&common);
  }

  std::vector<Index> order();
  void analyse(std::vector<Index> order);
  void add_column(Index j, const std::vector<Index>& places, const Index* local, double* column);
};

/// An order of the free unknowns that keeps the factor small, found on the graph of the nodes (a
/// ninth of the edges) and expanded to their directions.
std::vector<Index> Cholesky::State::order() {
  auto* graph = lower_pattern(
      matrix.nodes(),
      [&](std::size_t n, auto&& entry) {
        for (const auto m : matrix.row(n)) entry(static_cast<Index>(m));
      },
      common);
  std::vector<Index> nodes(matrix.nodes()), result;
  const int done = cholmod_l_metis(graph, nullptr, 0, 1, nodes.data(), &common);
  cholmod_l_free_sparse(&graph, &common);
  if (!done) out_of_memory("order");
  result.reserve(free.unknowns.size());
  for (const auto n : nodes)
    for (std::size_t d = 0; d < 3; ++d) {
      const auto position = free.positions[3 * static_cast<std::size_t>(n) + d];
      if (position >= 0) result.push_back(position);
    }
  return result;
}

void Cholesky::State::analyse(std::vector<Index> order) {
  const auto visit = [&](std::size_t j, auto&& entry) {
    for (const auto m : matrix.row(free.unknowns[j] / 3))
      for (std::size_t d = 0; d < 3; ++d) entry(free.positions[3 * std::size_t{m} + d]);
  };
  auto* pattern = lower_pattern(free.unknowns.size(), visit, common);
  common.supernodal = CHOLMOD_SUPERNODAL;
  common.nmethods = 1;
  common.method[0].ordering = CHOLMOD_GIVEN;
  factor = cholmod_l_analyze_p(pattern, order.data(), nullptr, 0, &common);
  cholmod_l_free_sparse(&pattern, &common);
  if (!factor) out_of_memory("analyse");
  flops = common.fl;
}

void Cholesky::State::add_column(Index j, const std::vector<Index>& places, const Index* local,
                                 double* column) {
  const auto from = static_cast<const Index*>(factor->Perm)[j];
  const auto unknown = free.unknowns[static_cast<std::size_t>(from)];
  const auto row = matrix.row(unknown / 3);
  for (std::size_t k = 0; k < row.size(); ++k)
    for (std::size_t d = 0; d < 3; ++d) {
      const auto position = free.positions[3 * std::size_t{row[k]} + d];
      if (position < 0) continue;
      const auto place = places[static_cast<std::size_t>(position)];
      if (place >= j) column[local[place]] += matrix.block(unknown / 3, k)[3 * (unknown % 3) + d];
    }
}

Cholesky::Cholesky(const BlockMatrix& matrix, const Fixed& fixed)
    : state_(std::make_unique<State>(matrix, fixed)) {
  state_->analyse(state_->order());
}

Cholesky::~Cholesky() = default;
Cholesky::Cholesky(Cholesky&&) noexcept = default;

double Cholesky::bytes() const {
  const auto& factor = *state_->factor;
  return static_cast<double>(factor.xsize + factor.maxcsize) * sizeof(double) +
         static_cast<double>(factor.ssize + 6 * factor.n) * sizeof(Index);
}

double Cholesky::flops() const { return state_->flops; }

void Cholesky::factor(const std::vector<Vec3>& points) {
  auto& s = *state_;
  const auto* order = static_cast<const Index*>(s.factor->Perm);
  std::vector<Index> places(s.factor->n);
  for (std::size_t j = 0; j < places.size(); ++j)
    places[static_cast<std::size_t>(order[j])] = static_cast<Index>(j);
  const auto add = [&](Index j, const Index* local, double* column) {
    s.add_column(j, places, local, column);
  };
  const auto failed = factor_supernodes(*s.factor, s.common, add);
  if (!failed) return;
  const auto unknown = s.free.unknowns[static_cast<std::size_t>(order[*failed])];
  const auto& p = points[unknown / 3];
  throw io::UserError(fmt::format(
      "The structure is a mechanism: near ({:.4g}, {:.4g}, {:.4g}) it can move along {} without "
      "strain. Look for parts that touch in a point or an edge only.",
      p[0], p[1], p[2], "xyz"[unknown % 3]));
}

void Cholesky::solve(const Vector& b, Vector& x) {
  auto& s = *state_;
  const auto count = s.free.unknowns.size();
  if (!s.b) s.b = cholmod_l_allocate_dense(count, 1, count, CHOLMOD_REAL, &s.common);
  if (!s.b) out_of_memory("solve with");
  for (std::size_t i = 0; i < count; ++i)
    static_cast<double*>(s.b->x)[i] = b[static_cast<Eigen::Index>(s.free.unknowns[i])];
  if (!cholmod_l_solve2(CHOLMOD_A, s.factor, s.b, nullptr, &s.x, nullptr, &s.work_y, &s.work_e,
                        &s.common))
    out_of_memory("solve with");
  x = Vector::Zero(b.size());
  for (std::size_t i = 0; i < count; ++i)
    x[static_cast<Eigen::Index>(s.free.unknowns[i])] = static_cast<const double*>(s.x->x)[i];
}

}  // namespace acopla::fem
