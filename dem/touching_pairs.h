// Pairs that touch or nearly touch, sorted by their pair of materials, with the histories of their contacts.
#pragma once

#include <vector>

#include "dem/kernel_table.h"
#include "dem/neighbours.h"

namespace acopla::dem {

/// Histories between two lists of neighbours: the particles may have new places in between.
class SavedPairs {
 public:
  /// Forgets all. @param writers  who may add at the same time
  void clear(std::size_t writers);
  void add(std::size_t writer, std::uint32_t i, std::uint32_t j, std::size_t group, const HistoryLane* first, std::size_t numbers, std::size_t lane);
  /// Gives the pairs their new places, and sorts them by the lower one. @param place  new place of every old one; `gone` where removed
  void settle(const std::vector<std::uint32_t>& place, const KernelTable& kernels, std::size_t particles);
  /// The history of the pair i < j in that group, or null.
  const double* find(std::uint32_t i, std::uint32_t j) const;

  static constexpr std::uint32_t gone = ~0u;

 private:
  struct Pair {
    std::uint32_t i, j;
    std::uint16_t group, writer;
    std::uint32_t first;  // in the writer's values
  };
  struct Written {
    std::vector<Pair> pairs;
    std::vector<double> values;
  };
  std::vector<Written> written_;
  std::vector<Pair> sorted_;
  std::vector<std::uint32_t> start_;
};

/// The touching pairs of one partition: those that the list of neighbours holds and that are nearer than a small skin of their own, so
/// that the list serves for some steps. Pairs whose second member is another partition's particle are kept apart: the force on that
/// member is exported.
class TouchingPairs {
 public:
  /// Looks who came near and who left; the others keep their places and histories. Where the list of neighbours is new, all pairs are
  /// found anew, with their histories from `saved`.
  /// @param rows  neighbours of the particles first, first + 1, … last − 1
  /// @param one_material  all particles of the scene are of one
  void refresh(const Particles& particles, const PairList& rows, std::uint32_t first, std::uint32_t last, double skin,
               const KernelTable& kernels, bool one_material, const SavedPairs* saved);
  /// Adds every history that is not zero.
  void save(SavedPairs& saved, std::size_t writer, const KernelTable& kernels) const;
  /// Forces of all pairs.
  void evaluate(const KernelTable& kernels, Particles& particles, double step, ContactEnergy<double>* energy);

  /// Forces on other partitions' particles, one a pair of the groups that export, and who they are.
  Exports exports;
  std::size_t export_count() const { return export_count_; }
  template <class Visit>
  void for_each_export(Visit&& visit) const {  // visit(particle, place in exports)
    for (const auto& group : groups_)
      if (group.exports)
        for (std::size_t c = 0; c < group.size; ++c) visit(group.j[c], group.first_export + c);
  }
  template <class Visit>
  void for_each(Visit&& visit) const {  // visit(i, j)
    for (const auto& group : groups_)
      for (std::size_t c = 0; c < group.size; ++c) visit(group.i[c], group.j[c]);
  }
  std::size_t size() const;
  std::size_t bytes() const;

  template <class Archive>
  void state(Archive& archive) {
    archive("groups", groups_);
    archive("listed", listed_);
    archive("own_count", own_count_);
    archive("place", place_);
    archive("near", near_);
    archive("free", free_);
    archive("export_count", export_count_);
    exports.force.resize(export_count_);
    exports.torque.resize(export_count_);
  }

 private:
  struct Listed {
    std::uint32_t i, j;
  };
  void list(const PairList& rows, std::uint32_t first, std::uint32_t last);
  std::vector<Listed> listed_;  // the neighbours in the order in which they are looked at: own pairs, then those that export
  std::uint32_t own_count_ = 0;
  static constexpr std::uint32_t nowhere = ~0u;
  void enter(std::uint32_t slot, std::size_t of, const KernelTable& kernels);
  void restore(const SavedPairs& saved, const KernelTable& kernels);
  std::vector<std::uint32_t> place_;             // in its group, of everybody listed; nowhere: it was not near yet, or lost its place
  std::vector<std::uint8_t> near_;               // who listed is near, a bit each
  std::vector<std::vector<std::uint32_t>> free_; // places of a group whose pairs are not near any more; may be out of date
  // Of group g: its own pairs at 2 g, those that export at 2 g + 1.
  std::vector<PairContacts> groups_;
  std::size_t export_count_ = 0;
};

}  // namespace acopla::dem
