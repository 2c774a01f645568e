// Who may touch whom: a hierarchical grid over the particles, and from it a list of pairs that stays valid while nobody has
// moved by half its skin; and the order in which the particles lie best in memory.
//
// A rebuild is
//   curve_order(positions, order); particles.reorder(order);   // now and then: neighbours in space, neighbours in memory
//   grid.build(positions, skin);                                // one thread
//   grid.find_pairs(first, last, rows);                         // any number of threads, each its own rows
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "dem/particles.h"

namespace acopla::dem {

/// Pairs of particles within the sum of their radii and the skin, each pair once (CSR). The rows are those of a range of
/// particles [first, last): row k, the entries start[k] to start[k + 1] of `second`, holds the partners of particle
/// first + k with an index higher than its own, ascending.
struct PairList {
  std::vector<std::uint32_t> start;   ///< one a row, and the end
  std::vector<std::uint32_t> second;  ///< the partner's index
  std::uint64_t examined = 0;         ///< distances computed to find them, to particles and to cells: the cost of the search
  std::size_t size() const { return second.size(); }
};

/// Hierarchical grid (Ogarko & Luding 2012): every particle lies in the level whose cells are just larger than its reach, the
/// diameter and the skin; the cells of a level are twice those of the next finer one. A particle looks for partners of its
/// own and of coarser levels in the cells around it, and for finer ones only in cells that hold any and are near its surface,
/// so that the largest do not set the price of the smallest. Radii within a factor of about two make one level.
///
/// Cells without particles take no memory where they are many: it is bounded by some hundred bytes a particle and level, however
/// far apart they are. In 2D all z are equal, which is seen from the positions. Everything is kept from call to call.
class HierarchicalGrid {
 public:
  /// Sorts the particles into cells. The positions are copied.
  /// @param positions  x, y, z [m]; w: radius [m], not negative. Fewer than 2³¹ of them, in any order, fastest along
  ///                   curve_order()
  /// @param skin       what is added to the sum of two radii [m], not negative
  /// @throws std::invalid_argument where a number is not finite or negative as it must not be
  void build(std::span<const Record> positions, double skin);

  /// The rows of particles [first, last), first ≤ last ≤ size(): every pair with |x_i − x_j| < r_i + r_j + skin as given to
  /// build(). Rows do not depend on how they are split into ranges, nor on the thread. Reads only; several threads may call it,
  /// each with a list of its own.
  void find_pairs(std::uint32_t first, std::uint32_t last, PairList& rows) const;

  std::size_t size() const { return home_.size(); }
  std::size_t levels() const { return level_count_; }
  /// Cells kept in memory: of all levels those that hold particles, of their own level or of finer ones; or, where one level
  /// fills at most eight cells a particle, all.
  std::size_t cells() const;

 private:
  struct CellRange {
    std::uint32_t begin = 0, end = 0;
  };
  struct Entry {
    std::uint64_t key;
    std::uint32_t item;
    bool is_cell;  // of the next finer level; else a particle
  };
  using Coordinates = std::array<std::uint32_t, 3>;
  static Coordinates coarser(const Coordinates& at, std::size_t levels) { return {at[0] >> levels, at[1] >> levels, at[2] >> levels}; }

  // The cells of one level in rows along x, rows along y, and those along z; only cells that hold something.
  struct Level {
    std::vector<std::uint64_t> key;            // ascending; three sentinels at the end
    std::vector<Coordinates> at;               // in cells of this level; one more at the end
    std::vector<std::uint32_t> first;          // slot of the first particle; one more at the end
    std::vector<CellRange> around;             // `rows_around_` a cell: the cells beside it and in the rows around it
    std::vector<std::uint32_t> highest;        // of its own particles, index + 1; 0: none
    std::vector<std::uint32_t> highest_finer;  // of the particles in finer cells inside it
    std::vector<std::uint32_t> parent;         // cell of the next coarser level
    std::vector<std::array<CellRange, 4>> children;  // cells of the next finer level inside it, by row
    std::vector<std::uint32_t> coarser_cell;   // the nearest cell that contains it and has particles in or around it,
    std::vector<std::uint8_t> coarser_level;   // and its level; `none` where there is no such cell
    std::size_t cells() const { return first.size() - 1; }
    double size = 1;                           // of a cell, in finest cells
    double largest = 0, largest_to_here = 0;   // radius in this level, and in this and finer ones
  };
  static constexpr std::uint8_t none = 255;

  // Numbers of the cells of one level.
  struct Numbering {
    std::uint64_t row, layer, corner;
    std::uint64_t operator()(const Coordinates& at) const { return at[2] * layer + at[1] * row + at[0] + corner; }
    // What is added to the number of a cell for that of the cell so many rows and layers away (modulo 2⁶⁴).
    std::uint64_t offset(int rows, int layers) const {
      return static_cast<std::uint64_t>(layers) * layer + static_cast<std::uint64_t>(rows) * row;
    }
  };

  struct Search;
  struct Climb;
  Search search_of(std::uint32_t i) const;
  std::uint32_t search_table(std::uint32_t i, std::uint32_t found, PairList& rows) const;
  std::uint32_t search_levels(std::uint32_t i, std::uint32_t found, PairList& rows) const;

  bool deep() const { return rows_around_ == 9; }
  Coordinates cell_of(const Record& p) const;
  void merge_sparse_levels(std::span<const Record> positions);
  void choose_levels(std::span<const Record> positions, double smallest, double largest);
  Numbering numbering(std::size_t l) const;
  bool fits_table(std::size_t count) const;
  void fill_table(std::span<const Record> positions);
  void place(std::uint32_t i, const Record& particle, std::uint32_t slot);
  void make_level(std::size_t l, std::span<const Record> positions);
  void link_rows(Level& level, const Numbering& number) const;
  void link_levels();
  std::uint8_t level_of(double radius) const;

  double skin_ = 0, edge_ = 0;  // of the finest cells
  std::array<double, 3> low_{};
  Coordinates counts_{};  // of the finest cells
  std::size_t level_count_ = 0, rows_around_ = 9;
  std::vector<std::uint32_t> table_;  // first slot of cell c at c; empty where there are levels instead
  std::array<std::uint32_t, 9> offsets_{};  // in the table, of the rows around a cell
  std::vector<Level> levels_;

  std::vector<std::uint32_t> home_, slot_of_;      // of each particle: cell in its level, place in the arrays below
  std::vector<std::uint8_t> level_of_;             // of each particle, where there are levels
  std::vector<double> x_, y_, z_, w_;              // by level and cell, padded
  std::vector<std::uint32_t> index_;               // which particle
  std::vector<Entry> entries_, entries_scratch_;
};

/// The particles along a Hilbert curve: cells of about the smallest diameter, those of one cell in the order in which they are
/// now. Any contiguous range of it is a compact blob, so that few pairs cross from one range to the next. In 2D, the curve is.
/// @param order  entry k is the index of the particle that should be k-th: what Particles::reorder wants
/// @throws std::invalid_argument where a number is not finite
void curve_order(std::span<const Record> positions, std::vector<std::uint32_t>& order);

/// The same behind the calls of dem/engine_of.h: `reach` is the largest distance of two centres that must be found.
class CellGrid {
 public:
  void build(const std::vector<Record>& positions, double /*reach*/) { curve_order(positions, order_); }
  const std::vector<std::uint32_t>& order() const { return order_; }
  void find_pairs(const std::vector<Record>& positions, double skin, PairList& pairs) {
    grid_.build(positions, skin);
    grid_.find_pairs(0, static_cast<std::uint32_t>(positions.size()), pairs);
  }

 private:
  HierarchicalGrid grid_;
  std::vector<std::uint32_t> order_;
};

}  // namespace acopla::dem
