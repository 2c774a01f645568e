// What the coupler reads of a case: who takes part, which surfaces meet, over which windows, and
// what is expected.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "coupler/acceleration/acceleration.h"
#include "coupler/mapping/mapping.h"
#include "geometry/surface_mesh.h"
#include "io/case_table.h"

namespace acopla::coupler {

/// A surface by its owner, written "grains.box".
struct SurfaceName {
  std::string participant, surface;
  std::string text() const { return participant + "." + surface; }
  bool operator==(const SurfaceName&) const = default;
};

/// [[coupling.interface]]: forces go from one surface to another, or, without `to`, into the record
/// alone.
struct InterfaceCase {
  SurfaceName from, to;
  io::Location at, from_at, to_at;
  MappingKind mapping = MappingKind::conservative;
  bool consistent_motion = false;  ///< two-way: the motion by Mapping::values, not by the transpose of the forces
  bool slides = false;  ///< one-way: `from` moves by itself along `to`, which stands, and the mapping is made anew in every window
  /// Interfaces of one table, whose `to` lists several surfaces: each point of `from` belongs to one of them. 0: not shared.
  std::size_t share = 0;
  bool recorded_only() const { return to.participant.empty(); }
  std::string text() const {
    return recorded_only() ? from.text() + " (recorded)" : from.text() + " to " + to.text();
  }
};

/// A recorded participant plays instead of a live one.
struct ReplayCase {
  std::string file;  ///< an interface.h5; absolute, or as given on a command line
  std::string of;    ///< its name in the record; empty: its own, or the only one recorded
  std::optional<double> from, to;  ///< part of the record that is played [s]; default all of it
  double at = 0;                   ///< time of this run at which `from` is played [s]
};

struct ParticipantCase {
  std::string name;
  std::string solver;                ///< "dem" means acopla-dem; empty for the other two sorts
  std::vector<std::string> command;  ///< any program that speaks the protocol
  std::optional<ReplayCase> replay;
  std::optional<double> advance_limit;  ///< longest time without an answer [s]
  io::Location at;
  /// The executable, for messages: "acopla-dem", "python3", "a record".
  std::string program() const;
};

enum class SchemeKind { one_way, serial_explicit, parallel_explicit, serial_implicit };

/// How a window of the implicit scheme converges.
struct ImplicitSettings {
  AccelerationOptions acceleration;
  double relative = 1e-6;      ///< of the motion of a window, and of its forces
  double displacement = 0;     ///< norm over all nodes [m]
  double force = 0;            ///< norm over all nodes [N]
  int most_iterations = 50;
  bool stops = true;           ///< where a window does not converge
};

enum class Loads { history, running_mean, mean, snapshot, peak };  ///< load_filter.h

struct LedgerLimits {
  double force_loss = 1e-12;
  double moment_loss = 1e-12;
  std::int64_t unmapped = 0;
  std::optional<double> energy_made;  ///< of all windows so far [J]
};

/// "participant.quantity" = { value, relative | absolute, … } of [expect].
struct Expectation {
  std::string name;
  double value = 0, tolerance = 0;
  bool relative = true;
  double mean_over = 0;  ///< [s]; 0: one window
  double at = 0;         ///< [s]
  std::string source;
  io::Location where;
};

/// How long a window is, where the case does not say it in seconds but in steps of the participant with the shortest.
struct WindowInSteps {
  std::int64_t count = 0;  ///< 0: the window is given in seconds
  bool automatic = false;  ///< as many as are stable, from one up to `longest`; a tick is then a step
  io::Location at;
  /// Ticks of the longest window. Messages are then a few percent of the steps' time, and a first contact is not missed by much.
  static constexpr std::int64_t longest = 64;
};

struct Case {
  std::string file, title;
  int dimension = 3;
  geometry::Vec3 gravity = geometry::Vec3::Zero();
  double end = 0;               ///< [s]
  WindowInSteps in_steps;
  double window = 0;            ///< [s], and a tick; 0 until divide() where it is in steps
  std::int64_t windows = 0;     ///< of that length
  SchemeKind scheme = SchemeKind::one_way;
  ImplicitSettings implicit;
  bool allows_unstable = false;  ///< explicit schemes
  Loads loads = Loads::history;
  std::int64_t loads_from = 0;  ///< first window that receivers are given (history)
  std::int64_t load_start = 0;  ///< windows [load_start, load_end) of a mean, peak or snapshot
  std::int64_t load_end = 0;
  std::int64_t load_windows = 1;  ///< of a running mean
  double max_distance = 0;        ///< [m]
  double start_limit = 60;        ///< [s]
  std::int64_t output_every = 1;  ///< windows between pictures
  bool record_motion = false;     ///< two-way: of the surfaces that answer, so that they can be replayed
  std::int64_t checkpoint_every = 0;  ///< windows; 0: none are written
  /// Times [s] that divide() turns into windows.
  struct Times {
    double output_every = 0, checkpoint_every = 0, loads_from = 0, load_at = 0, load_over = 0;
  } times;
  std::string text;  ///< what the file says, but for what may change when a run is resumed (io::Table::canonical)
  LedgerLimits limits;
  std::vector<InterfaceCase> interfaces;  ///< none where a participant is alone
  std::vector<ParticipantCase> participants;
  std::vector<Expectation> expectations;

  /// The last window that may be complete before a checkpoint is written, when so many are.
  std::int64_t next_checkpoint(std::int64_t complete) const {
    return checkpoint_every > 0 ? (complete / checkpoint_every + 1) * checkpoint_every : windows;
  }
  double time(std::int64_t windows_done) const {
    return static_cast<double>(windows_done) * window;
  }
  /// Makes windows of so many steps of this length [s], which it shortens until the end is a whole number of them.
  void divide(double step);
  const ParticipantCase* find(const std::string& participant) const;
  bool sends(const std::string& participant) const;
  bool receives(const std::string& participant) const;
};

/// A participant that a record replaces, whatever its table says (`acopla replay`).
struct Substitute {
  std::string participant;  ///< empty: the only one that sends
  ReplayCase replay;
};

/// Reads everything but the participants' own keys, which their solvers check. @throws
/// io::UserError, located
Case read_case(const io::Table& root, const std::optional<Substitute>& substitute = {});

}  // namespace acopla::coupler
