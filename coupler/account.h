// The account of a run: its interfaces, and window by window what went through them and what was lost.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "coupler/case.h"
#include "coupler/crew.h"
#include "coupler/mapping/mapping.h"
#include "coupler/outcome.h"
#include "coupler/quantities.h"
#include "coupler/record.h"
#include "coupler/reporter.h"
#include "coupler/travel.h"

namespace acopla::coupler {

/// An interface with its surfaces and the mapping between them.
struct Link {
  const InterfaceCase* about = nullptr;
  const geometry::SurfaceMesh *from = nullptr, *to = nullptr;  ///< to, mapping: null where the forces are recorded only
  std::unique_ptr<Mapping> mapping;
  std::unique_ptr<Travel> travel;  ///< of an interface that slides; else null
  std::vector<char> own;  ///< of the points of `from`, where several interfaces share them; else empty
  geometry::Vec3 centre = geometry::Vec3::Zero();  ///< of `from`, about which moments are taken [m]
  bool alone = true;                               ///< no other interface ends on `to`
  /// `from`, where forces on it meet `to`.
  const geometry::SurfaceMesh& place() const { return travel ? travel->midway() : *from; }
  /// The forces that the interface carries of those on `from`, one per point: as `from` has turned, without those of points that belong to others [N].
  std::vector<geometry::Vec3> carried(std::span<const geometry::Vec3> forces) const;
};

/// What every scheme keeps: it builds the mappings, and books each window once everybody is through it.
class Account {
 public:
  /// @throws io::UserError located at the interface whose surfaces do not exist or do not meet
  Account(const Case& read, Crew& crew, Record& record, Quantities& quantities, Reporter& reporter);

  const std::vector<Link>& links() const { return links_; }
  using Forces = std::map<std::string, std::vector<geometry::Vec3>>;  // surface → one force per point [N]

  /// Maps what `sender` sent in a window, which goes into the record, onto the surfaces that receive it, which grow by it. Windows must come in
  /// their order. @throws Failure where a surface cannot be followed
  void map_forces(const std::string& sender, protocol::Advance& advance, WindowRecord& window, Forces& received);
  /// Enters in the ledger what went through the interfaces from `sender`, once all its forces are mapped: nobody need wait for it.
  void balance(const std::string& sender, WindowRecord& window, const Forces& received) const;
  /// The part of what arrived on a surface that came through one interface.
  const std::vector<geometry::Vec3>& arrived(std::size_t interface, const WindowRecord& window, const Forces& received) const;

  /// How a surface that answers begins, where its motion is recorded.
  void set_initial(const std::string& surface, std::span<const geometry::Vec3> displacement, std::span<const geometry::Vec3> velocity) {
    if (case_.record_motion) record_.set_initial(surface, displacement, velocity);
  }
  void begin();  ///< computing begins
  void flush() { record_.flush(); }  ///< all windows are on disk
  template <class Archive>
  void state(Archive& archive) {
    archive("complete", complete_);
    archive("rows", rows_);
    archive("ledgers", ledgers_);
    for (auto& interface : interfaces_) archive("worst_loss." + interface.name, interface.worst_loss);
    archive("quantities", quantities_);
    for (std::size_t k = 0; k < links_.size(); ++k)
      if (links_[k].travel) archive("travel." + std::to_string(k), *links_[k].travel);
  }
  /// Writes the next window, and compares it with the limits. @throws Failure beyond one
  void close(WindowRecord& window);

  std::int64_t complete() const { return complete_; }  ///< ticks of the windows written
  std::int64_t rows() const { return rows_; }          ///< windows written
  double seconds() const { return seconds_; }          ///< from begin() to the last of them
  const Ledgers& ledgers() const { return ledgers_; }
  const std::vector<InterfaceOutcome>& interfaces() const { return interfaces_; }

 private:
  void link(const InterfaceCase& interface);
  void follow(const std::string& sender, protocol::Advance& advance, WindowRecord& window);
  void share(std::size_t first);
  void map(Link& link);
  void check_limits(const WindowRecord& window) const;

  const Case& case_;
  Crew& crew_;
  Record& record_;
  Quantities& quantities_;
  Reporter& reporter_;
  std::vector<Link> links_;
  std::int64_t complete_ = 0, rows_ = 0;
  Ledgers ledgers_;
  std::vector<InterfaceOutcome> interfaces_;
  std::chrono::steady_clock::time_point begin_;
  double seconds_ = 0;
};

}  // namespace acopla::coupler
