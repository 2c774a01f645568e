// The deal.II structure as a participant.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "fem/settings.h"
#include "io/series.h"
#include "io/vtk.h"
#include "protocol/participant.h"

namespace acopla::fem {

class Team;

/// An elastic structure under the mean forces of each window, its weight and its own loads: in
/// static equilibrium with them, or in motion. Receives "force", sends "displacement" and
/// "velocity" (zero of a static one) on physical surfaces of its mesh, lines in 2D. Reports
/// reaction.x, .y, .z (force of the supports and foundations on the structure), load.x, .y, .z (received forces,
/// weight and loads) [N], displacement.max [m], von_mises.max [Pa], and of a structure in motion
/// velocity.max [m/s] and, when asked for, energy.kinetic, .strain, .work, .damping and .error [J].
/// Reactions and loads of a structure in motion are means over the window.
class Structure : public protocol::Participant {
 public:
  /// @param team  of several processes, whose first this is, that share the matrices; null: this process has them all. It must outlive this.
  explicit Structure(Settings settings, Team* team = nullptr);
  ~Structure() override;

  protocol::Introduction introduce() const override;
  std::vector<protocol::Surface> start(const protocol::Run& run) override;
  protocol::Advance advance(const protocol::Window& window,
                            const std::vector<protocol::Field>& received) override;
  std::vector<std::pair<std::string, double>> finish() override;
  void save() override;
  void restore() override;
  void checkpoint(const std::string& folder) override;
  void resume(const std::string& folder) override;

 private:
  struct Body;
  struct Coupled;
  /// What a window gave, beside the motion.
  struct Response {
    Vector reaction, load;  ///< of every node [N]
    std::uint64_t steps = 1;
  };
  Vector received_load(const std::vector<protocol::Field>& received) const;
  Response equilibrate(const protocol::Window& window, const Vector& force);
  Response move(const protocol::Window& window, const Vector& force);
  void begin_motion();
  template <class Archive>
  void checkpointed(Archive& archive);
  void check_frequencies() const;
  std::vector<std::pair<std::string, double>> frequencies() const;
  void find_probes();
  void add_probes(std::vector<std::pair<std::string, double>>& result) const;
  void add_reactions(const Vector& reaction,
                     std::vector<std::pair<std::string, double>>& result) const;
  void add_torques(const Vector& reaction, const Vector& load, std::vector<std::pair<std::string, double>>& result) const;
  std::vector<std::pair<std::string, double>> quantities(const Response& response) const;
  std::vector<protocol::Field> fields() const;
  bool is_due(const protocol::Window& window) const;
  void draw();
  void write_nodal(const std::string& path);

  /// What a rejected iteration must undo.
  struct State {
    Motion motion;
    Energy passed;     ///< work and losses since the start, energies now
    bool due = false;  ///< a picture of it is wanted
    bool drawn = true;
  };
  /// A node that is reported, and the cells that meet there where its stress is.
  struct Probed {
    std::string name;
    std::uint32_t node = 0;
    std::vector<std::size_t> cells;
  };
  struct Seconds {
    double setup = 0, factor = 0, solve = 0;
  };

  Settings settings_;
  Team* team_ = nullptr;
  protocol::Run run_;
  std::unique_ptr<Body> body_;
  std::vector<Coupled> coupled_;
  std::vector<Probed> probed_;
  std::vector<std::pair<std::string, std::vector<std::size_t>>>
      supported_;  // unknowns of each support, when asked for
  State state_, saved_;
  double start_energy_ = 0;
  Seconds seconds_;
  double worst_residual_ = 0;
  int pictures_ = 0;
  std::optional<io::PvdSeries> series_;
  std::unique_ptr<io::SeriesWriter> nodal_;  // when asked for, from the first picture on
};

/// Plain lines on what a run will do: cells, unknowns, solver, memory, expected time. Reads the
/// mesh and analyses the stiffness, but factors nothing. @throws io::UserError
std::string explain(const Settings& settings);

}  // namespace acopla::fem
