// What a run leaves behind: interface.h5, which can be replayed, and pictures of the loaded
// surfaces.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "coupler/case.h"
#include "coupler/mapping/balance.h"
#include "io/series.h"
#include "io/vtk.h"

namespace acopla::coupler {

/// One window of one interface: what went in and what came out.
struct LedgerRow {
  Resultant sent, received;  ///< about the centroid of the sending surface
  Loss loss;
  std::size_t unmapped = 0;   ///< points without a partner
  double worst_distance = 0;  ///< of a point from its partner [m]
  /// Two-way: of the forces on the nodes that receive them, over the way the structure went, and over that of the surface that sent
  /// them [J].
  double work_received = 0, work_sent = 0;
};

/// Everything of one window, gathered until all participants are through it.
struct WindowRecord {
  std::int64_t ticks = 1;                                     ///< its length
  std::vector<LedgerRow> ledger;                              ///< one per interface of the case
  std::map<std::string, std::vector<geometry::Vec3>> forces;  ///< "grains.box" → one per point [N]
  std::vector<std::vector<geometry::Vec3>> arrived;  ///< per interface, where several end on one surface: its part there [N]
  std::vector<std::pair<std::string, double>> quantities;     ///< "participant.quantity"
  struct Motion {
    std::vector<geometry::Vec3> displacement, velocity;
  };
  /// At the window's end [m], [m/s]: of the surfaces that answer, where it is asked for, and, without velocity, of those that interfaces follow.
  std::map<std::string, Motion> motion;
  std::int64_t iterations = 0;  ///< implicit
  double residual = 0;          ///< implicit: of the motion, over that of the window
  bool converged = true;
  bool jumped = false;  ///< implicit: it ends on one side of a jump of the forces, the motion known within its tolerance
  double energy_made = 0;  ///< until the window's end [J]
};

class Record {
 public:
  /// Writes into `folder`, or nothing at all where it is empty. @throws io::UserError
  /// @param rows, resumes_after  windows that a run before has written there and that stay, and their ticks
  Record(const Case& read, const std::string& folder, std::int64_t rows = 0, std::int64_t resumes_after = 0);
  void add_surface(const std::string& name, const geometry::SurfaceMesh& mesh);
  /// How a surface begins whose motion is recorded. @param velocity  empty where it is not
  void set_initial(const std::string& surface, std::span<const geometry::Vec3> displacement, std::span<const geometry::Vec3> velocity);
  ~Record();
  Record(const Record&) = delete;
  Record& operator=(const Record&) = delete;
  /// Appends the window from tick `index` on, which must follow the last one. The file is written and flushed at once where windows are long, and else some
  /// times a second, in one go: a flush costs more than a short window, and between two of them the file stays whole.
  void write(std::int64_t index, const WindowRecord& window);
  void flush() { write_pending(); }

  /// What is on disk: windows, and the tick at which the last of them ends.
  struct Kept {
    std::int64_t rows = 0, complete = 0;
  };
  /// Nothing unless windows were lost, as a full disk loses the last ones.
  std::optional<Kept> cut_short() const { return lost_ ? std::optional(kept_) : std::nullopt; }

 private:
  void write_pending();
  void append(std::int64_t index, const WindowRecord& window);
  void write_ledger(const WindowRecord& window);
  void write_picture(std::int64_t complete, const std::string& surface,
                     const std::vector<geometry::Vec3>& force);

  const Case& case_;
  std::string folder_;
  std::int64_t resumes_after_;
  std::unique_ptr<io::SeriesWriter> series_;
  std::map<std::string, geometry::SurfaceMesh> surfaces_;
  std::map<std::string, io::PvdSeries> pictures_;
  std::vector<std::pair<std::int64_t, WindowRecord>> pending_;
  std::size_t pending_values_ = 0;
  std::chrono::steady_clock::time_point written_{};
  Kept kept_;
  bool lost_ = false;
};

}  // namespace acopla::coupler
