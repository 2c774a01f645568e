#include "fem/supernodal.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <new>
#include <vector>

namespace acopla::fem {
namespace {

using Index = SuiteSparse_long;
using Panel = Eigen::Map<Eigen::MatrixXd>;

/// A pivot this small against the diagonal it came from is round-off: the structure is a mechanism.
/// The softest slender beam of practice keeps about 1e-10.
constexpr double least_pivot = 1e-14;

class Factorisation {
 public:
  explicit Factorisation(cholmod_factor& factor)
      : starts_(static_cast<Index*>(factor.super)),
        row_starts_(static_cast<Index*>(factor.pi)),
        value_starts_(static_cast<Index*>(factor.px)),
        rows_(static_cast<Index*>(factor.s)),
        values_(static_cast<double*>(factor.x)),
        count_(static_cast<Index>(factor.nsuper)),
        local_(factor.n),
        owner_(factor.n),
        first_child_(factor.nsuper, -1),
        next_child_(factor.nsuper, -1),
        used_rows_(factor.nsuper, 0),
        update_(factor.maxcsize) {
    for (Index s = 0; s < count_; ++s)
      for (Index k = starts_[s]; k < starts_[s + 1]; ++k) owner_[place(k)] = s;
  }

  std::optional<Index> run(const AddColumn& add_column) {
    for (Index s = 0; s < count_; ++s) {
      assemble(s, add_column);
      const Eigen::VectorXd diagonal = panel(s).diagonal();
      subtract_descendants(s);
      if (const auto failed = factor_panel(s, diagonal)) return starts_[s] + *failed;
      used_rows_[place(s)] = columns(s);
      pass_on(s);
    }
    return std::nullopt;
  }

 private:
  static std::size_t place(Index i) { return static_cast<std::size_t>(i); }
  Index columns(Index s) const { return starts_[s + 1] - starts_[s]; }
  Index height(Index s) const { return row_starts_[s + 1] - row_starts_[s]; }
  const Index* rows(Index s) const { return rows_ + row_starts_[s]; }
  Panel panel(Index s) { return {values_ + value_starts_[s], height(s), columns(s)}; }

  void assemble(Index s, const AddColumn& add_column) {
    for (Index i = 0; i < height(s); ++i) local_[place(rows(s)[i])] = i;
    auto target = panel(s);
    target.setZero();
    for (Index k = 0; k < columns(s); ++k)
      add_column(starts_[s] + k, local_.data(), target.col(k).data());
  }

  void subtract_descendants(Index s) {
    auto target = panel(s);
    for (Index d = first_child_[place(s)], next = -1; d >= 0; d = next) {
      next = next_child_[place(d)];
      const Index first = used_rows_[place(d)];
      Index last = first;
      while (last < height(d) && rows(d)[last] < starts_[s + 1]) ++last;
      const auto source = panel(d);
      Panel update(update_.data(), height(d) - first, last - first);
      update.noalias() =
          source.bottomRows(height(d) - first) * source.middleRows(first, last - first).transpose();
      for (Index j = 0; j < update.cols(); ++j) {
        double* column = target.col(rows(d)[first + j] - starts_[s]).data();
        for (Index i = j; i < update.rows(); ++i)
          column[local_[place(rows(d)[first + i])]] -= update(i, j);
      }
      used_rows_[place(d)] = last;
      pass_on(d);
    }
  }

  /// Queues supernode `d` at the owner of its first row that no supernode has used yet.
  void pass_on(Index d) {
    const Index row = used_rows_[place(d)];
    if (row >= height(d)) return;
    const Index s = owner_[place(rows(d)[row])];
    next_child_[place(d)] = first_child_[place(s)];
    first_child_[place(s)] = d;
  }

  std::optional<Index> factor_panel(Index s, const Eigen::VectorXd& diagonal) {
    auto target = panel(s);
    Eigen::Ref<Eigen::MatrixXd> top = target.topRows(columns(s));
    const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> llt(top);
    for (Index k = 0; k < columns(s); ++k) {
      const double pivot = top(k, k);
      const bool sound = pivot * pivot > least_pivot * diagonal[k];
      if (!sound) return k;
    }
    if (llt.info() != Eigen::Success) return 0;
    if (height(s) > columns(s)) {
      auto below = target.bottomRows(height(s) - columns(s));
      llt.matrixL().transpose().solveInPlace<Eigen::OnTheRight>(below);
    }
    return std::nullopt;
  }

  const Index *starts_, *row_starts_, *value_starts_, *rows_;
  double* values_;
  Index count_;
  std::vector<Index> local_;                     // row of the factor -> row of the present panel
  std::vector<Index> owner_;                     // column -> supernode
  std::vector<Index> first_child_, next_child_;  // supernodes that wait to update one, in a list
  std::vector<Index> used_rows_;                 // rows of a supernode that have done their work
  std::vector<double> update_;
};

}  // namespace

std::optional<Index> factor_supernodes(cholmod_factor& factor, cholmod_common& common,
                                       const AddColumn& add_column) {
  if (!cholmod_l_change_factor(CHOLMOD_REAL, 1, 1, 1, 1, &factor, &common)) throw std::bad_alloc();
  return Factorisation(factor).run(add_column);
}

}  // namespace acopla::fem
