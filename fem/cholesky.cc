#include "fem/cholesky.h"

#include <cholmod.h>
#include <dlfcn.h>
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <optional>
#include <stdexcept>
#include <utility>

#include "io/error.h"
#include "io/large_memory.h"

extern "C" void dgemm_(const char* transpose_a, const char* transpose_b, const int* m, const int* n,
                       const int* k, const double* alpha, const double* a, const int* lda,
                       const double* b, const int* ldb, const double* beta, double* c,
                       const int* ldc);

namespace acopla::fem {
namespace {

using Index = SuiteSparse_long;

/// A pivot this small against the diagonal it came from is round-off: the structure is a mechanism.
/// The softest slender beam of practice keeps about 1e-10.
constexpr double least_pivot = 1e-14;
/// Columns of the factor that a substitution takes at a time.
constexpr int panel_width = 8;

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

/// The lower triangle of a symmetric matrix by columns, rows of a column in any order.
/// @param xtype  CHOLMOD_REAL, or CHOLMOD_PATTERN to leave the values out
/// @param visit  visit(j, f) calls f(i, value) for the entries of column j, above the diagonal too
template <class Visit>
cholmod_sparse* lower_triangle(std::size_t columns, int xtype, const Visit& visit,
                               cholmod_common& common) {
  std::size_t entries = 0;
  for (std::size_t j = 0; j < columns; ++j)
    visit(j, [&](Index i, double) { entries += i >= static_cast<Index>(j); });
  auto* result = cholmod_l_allocate_sparse(columns, columns, entries, 0, 1, -1, xtype, &common);
  if (!result) return nullptr;
  auto* starts = static_cast<Index*>(result->p);
  auto* rows = static_cast<Index*>(result->i);
  auto* values = static_cast<double*>(result->x);
  Index next = 0;
  for (std::size_t j = 0; j < columns; ++j) {
    starts[j] = next;
    visit(j, [&](Index i, double value) {
      if (i < static_cast<Index>(j)) return;
      if (values) values[next] = value;
      rows[next++] = i;
    });
  }
  starts[columns] = next;
  return result;
}

/// Calls `set(count)` if a library that the process has loaded offers it.
void set_threads(const char* set, int count) {
  if (auto* function = reinterpret_cast<void (*)(int)>(dlsym(RTLD_DEFAULT, set))) function(count);
}

/// One thread for the BLAS, if it is OpenBLAS, and for CHOLMOD: the particles use the other cores
/// at the same time, the sums of a product cut in threads may differ from run to run, and the four
/// OpenMP threads that CHOLMOD always asks for to scatter its updates cost 1.4 to 1.9 times the
/// processor time of one.
void compute_in_one_thread() {
  set_threads("openblas_set_num_threads", 1);
  set_threads("omp_set_max_active_levels", 0);
}

}  // namespace

struct Cholesky::State {
  const BlockMatrix& matrix;
  std::size_t dimension;
  FreeUnknowns free;
  cholmod_common common{};
  cholmod_factor* factor = nullptr;
  double flops = 0;
  Eigen::VectorXd ordered;  // right-hand side, then solution, in the factor's order
  Eigen::VectorXd panel;    // of the rows of a supernode

  State(const BlockMatrix& matrix_, const Fixed& fixed)
      : matrix(matrix_), dimension(static_cast<std::size_t>(matrix_.dimension())), free(fixed) {
    SuiteSparse_config.malloc_func = io::allocate_large;
    cholmod_l_start(&common);
    common.print = 0;
  }
  State(const State&) = delete;
  ~State() {
    cholmod_l_free_factor(&factor, &common);
    cholmod_l_finish(&common);
  }

  std::vector<Index> order();
  void analyse(std::vector<Index> order);
  cholmod_sparse* ordered_matrix();
  double diagonal(std::size_t unknown) const;
  std::optional<std::size_t> first_round_off() const;
  void substitute();

  /// The free unknown at a column of the factor.
  std::size_t unknown_of(std::size_t column) const {
    const auto position = static_cast<const Index*>(factor->Perm)[column];
    return free.unknowns[static_cast<std::size_t>(position)];
  }
  /// Calls entry(position, value) for the free unknowns that couple with `unknown`.
  template <class Entry>
  void visit_row(std::size_t unknown, Entry&& entry) const {
    const auto row = matrix.row(unknown / dimension);
    for (std::size_t k = 0; k < row.size(); ++k)
      for (std::size_t d = 0; d < dimension; ++d) {
        const auto position = free.positions[dimension * std::size_t{row[k]} + d];
        if (position >= 0)
          entry(position,
                matrix.block(unknown / dimension, k)[dimension * (unknown % dimension) + d]);
      }
  }
};

/// An order of the free unknowns that keeps the factor small, found on the graph of the nodes (a
/// ninth of the edges) and expanded to their directions.
std::vector<Index> Cholesky::State::order() {
  auto* graph = lower_triangle(
      matrix.nodes(), CHOLMOD_PATTERN,
      [&](std::size_t n, auto&& entry) {
        for (const auto m : matrix.row(n)) entry(static_cast<Index>(m), 0.0);
      },
      common);
  if (!graph) out_of_memory("order");
  std::vector<Index> nodes(matrix.nodes()), result;
  const int done = cholmod_l_metis(graph, nullptr, 0, 1, nodes.data(), &common);
  cholmod_l_free_sparse(&graph, &common);
  if (!done) out_of_memory("order");
  result.reserve(free.unknowns.size());
  for (const auto n : nodes)
    for (std::size_t d = 0; d < dimension; ++d) {
      const auto position = free.positions[dimension * static_cast<std::size_t>(n) + d];
      if (position >= 0) result.push_back(position);
    }
  return result;
}

void Cholesky::State::analyse(std::vector<Index> order) {
  auto* pattern = lower_triangle(
      free.unknowns.size(), CHOLMOD_PATTERN,
      [&](std::size_t j, auto&& entry) { visit_row(free.unknowns[j], entry); }, common);
  if (!pattern) out_of_memory("analyse");
  common.supernodal = CHOLMOD_SUPERNODAL;
  common.nmethods = 1;
  common.method[0].ordering = CHOLMOD_GIVEN;
  factor = cholmod_l_analyze_p(pattern, order.data(), nullptr, 0, &common);
  cholmod_l_free_sparse(&pattern, &common);
  if (!factor) out_of_memory("analyse");
  flops = common.fl;
}

/// The matrix in the factor's order.
cholmod_sparse* Cholesky::State::ordered_matrix() {
  const auto* order = static_cast<const Index*>(factor->Perm);
  std::vector<Index> columns(factor->n);
  for (std::size_t j = 0; j < columns.size(); ++j)
    columns[static_cast<std::size_t>(order[j])] = static_cast<Index>(j);
  const auto visit = [&](std::size_t j, auto&& entry) {
    visit_row(unknown_of(j), [&](Index position, double value) {
      entry(columns[static_cast<std::size_t>(position)], value);
    });
  };
  return lower_triangle(columns.size(), CHOLMOD_REAL, visit, common);
}

double Cholesky::State::diagonal(std::size_t unknown) const {
  const auto node = unknown / dimension;
  const auto row = matrix.row(node);
  const auto k = std::lower_bound(row.begin(), row.end(), node) - row.begin();
  return matrix.block(node, static_cast<std::size_t>(k))[(dimension + 1) * (unknown % dimension)];
}

/// The first column of the factor without a sound pivot. CHOLMOD stops at pivots that are not
/// positive only; a mechanism's may be round-off of either sign.
std::optional<std::size_t> Cholesky::State::first_round_off() const {
  const auto* starts = static_cast<const Index*>(factor->super);
  const auto* row_starts = static_cast<const Index*>(factor->pi);
  const auto* value_starts = static_cast<const Index*>(factor->px);
  const auto* values = static_cast<const double*>(factor->x);
  for (std::size_t s = 0, j = 0; j < factor->minor; ++j) {
    if (static_cast<Index>(j) == starts[s + 1]) ++s;
    const Index column = static_cast<Index>(j) - starts[s];
    const Index height = row_starts[s + 1] - row_starts[s];
    const double pivot = values[value_starts[s] + column * (height + 1)];
    const bool sound = pivot * pivot > least_pivot * diagonal(unknown_of(j));
    if (!sound) return j;
  }
  if (factor->minor < factor->n) return factor->minor;
  return std::nullopt;
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
  compute_in_one_thread();
  // What cholmod_l_factorize calls in the end, after two more copies of the matrix.
  auto* matrix = s.ordered_matrix();
  double nothing_added[2] = {0, 0};
  const bool done =
      matrix && cholmod_l_super_numeric(matrix, nullptr, nothing_added, s.factor, &s.common);
  cholmod_l_free_sparse(&matrix, &s.common);
  if (!done) out_of_memory("factor");
  const auto failed = s.first_round_off();
  if (!failed) return;
  const auto unknown = s.unknown_of(*failed);
  const auto& p = points[unknown / s.dimension];
  throw io::UserError(fmt::format(
      "The structure is a mechanism: near ({:.4g}, {:.4g}, {:.4g}) it can move along {} without "
      "strain. Look for parts that touch in a point or an edge only.",
      p[0], p[1], p[2], "xyz"[unknown % s.dimension]));
}

/// L y = b, then Lᵀ x = y, in place. One right-hand side leaves nothing to compute but what memory brings: the factor is read
/// as it lies, some columns at a time, twice. The BLAS would be called several times a supernode, most of which are small.
void Cholesky::State::substitute() {
  using Columns = Eigen::Map<const Eigen::MatrixXd>;
  const auto* starts = static_cast<const Index*>(factor->super);
  const auto* row_starts = static_cast<const Index*>(factor->pi);
  const auto* value_starts = static_cast<const Index*>(factor->px);
  const auto* all_rows = static_cast<const Index*>(factor->s);
  const auto* values = static_cast<const double*>(factor->x);
  if (panel.size() == 0) {
    Index most = 0;
    for (std::size_t s = 0; s < factor->nsuper; ++s) most = std::max(most, row_starts[s + 1] - row_starts[s]);
    panel.resize(most);
  }
  const auto supernodes = static_cast<Index>(factor->nsuper);
  for (Index s = 0; s < supernodes; ++s) {
    const Index first = starts[s], columns = starts[s + 1] - first, rows = row_starts[s + 1] - row_starts[s];
    const auto* row = all_rows + row_starts[s];
    const Columns L(values + value_starts[s], rows, columns);
    auto w = panel.head(rows);
    w.head(columns) = ordered.segment(first, columns);
    w.tail(rows - columns).setZero();
    for (Index j = 0; j < columns;) {
      const Index width = std::min<Index>(panel_width, columns - j), below = j + width;
      for (Index k = j; k < below; ++k) {
        for (Index i = j; i < k; ++i) w[k] -= L(k, i) * w[i];
        w[k] /= L(k, k);
      }
      const Index rest = rows - below;
      if (width == panel_width)
        w.tail(rest) -= ((L.col(j).tail(rest) * w[j] + L.col(j + 1).tail(rest) * w[j + 1]) +
                         (L.col(j + 2).tail(rest) * w[j + 2] + L.col(j + 3).tail(rest) * w[j + 3])) +
                        ((L.col(j + 4).tail(rest) * w[j + 4] + L.col(j + 5).tail(rest) * w[j + 5]) +
                         (L.col(j + 6).tail(rest) * w[j + 6] + L.col(j + 7).tail(rest) * w[j + 7]));
      else
        for (Index k = j; k < below; ++k) w.tail(rest) -= L.col(k).tail(rest) * w[k];
      j = below;
    }
    ordered.segment(first, columns) = w.head(columns);
    for (Index r = columns; r < rows; ++r) ordered[row[r]] += w[r];
  }
  for (Index s = supernodes - 1; s >= 0; --s) {
    const Index first = starts[s], columns = starts[s + 1] - first, rows = row_starts[s + 1] - row_starts[s];
    const auto* row = all_rows + row_starts[s];
    const Columns L(values + value_starts[s], rows, columns);
    auto w = panel.head(rows);
    w.head(columns) = ordered.segment(first, columns);
    for (Index r = columns; r < rows; ++r) w[r] = ordered[row[r]];
    for (Index below = columns; below > 0;) {
      const Index width = std::min<Index>(panel_width, below), j = below - width, rest = rows - below;
      if (width == panel_width)
        w.segment<panel_width>(j).noalias() -= L.block(below, j, rest, panel_width).transpose() * w.tail(rest);
      else
        for (Index k = j; k < below; ++k) w[k] -= L.col(k).tail(rest).dot(w.tail(rest));
      for (Index k = below - 1; k >= j; --k) {
        for (Index i = k + 1; i < below; ++i) w[k] -= L(i, k) * w[i];
        w[k] /= L(k, k);
      }
      below = j;
    }
    ordered.segment(first, columns) = w.head(columns);
  }
}

void Cholesky::solve(const Vector& b, Vector& x) {
  auto& s = *state_;
  const auto count = s.free.unknowns.size();
  s.ordered.resize(static_cast<Eigen::Index>(count));
  for (std::size_t j = 0; j < count; ++j) s.ordered[static_cast<Eigen::Index>(j)] = b[static_cast<Eigen::Index>(s.unknown_of(j))];
  s.substitute();
  x = Vector::Zero(b.size());
  for (std::size_t j = 0; j < count; ++j) x[static_cast<Eigen::Index>(s.unknown_of(j))] = s.ordered[static_cast<Eigen::Index>(j)];
}

double blas_rate() {
  using Clock = std::chrono::steady_clock;
  constexpr int n = 400;
  constexpr double one = 1, zero = 0;
  const Eigen::MatrixXd a = Eigen::MatrixXd::Constant(n, n, 1.0);
  Eigen::MatrixXd b(n, n);
  compute_in_one_thread();
  double best = 0;
  for (int trial = 0; trial < 3; ++trial) {
    const auto start = Clock::now();
    dgemm_("N", "T", &n, &n, &n, &one, a.data(), &n, a.data(), &n, &zero, b.data(), &n);
    const double seconds = std::chrono::duration<double>(Clock::now() - start).count();
    best = std::max(best, 2.0 * n * n * n / seconds);
  }
  return best;
}

}  // namespace acopla::fem
