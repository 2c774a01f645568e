// The particles as a participant: their surfaces are walls of meshes and lines.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "dem/engine.h"
#include "dem/step_watch.h"
#include "dem/traffic.h"
#include "io/archive.h"
#include "io/vtk.h"
#include "protocol/participant.h"

namespace acopla::dem {

/// Sends `force` [N] on every wall that has vertices: the mean over the window, per vertex, in the wall's body axes. Receives
/// `displacement` [m] and `velocity` [m/s] of a wall's vertices at the window's start; the wall then moves linearly until the next.
///
/// Quantities of a window: per wall WALL.force.x|y|z [N] and WALL.torque.x|y|z [N m] (means over the window; torque about the wall's
/// reference point), of servos WALL.travel [m]; weight [N], kinetic_energy [J], particles, contacts, step_ratio, overlap.max (over the
/// radius); with the ledger energy.* [J]; of inlets and outlets their masses [kg].
class Solver final : public protocol::Participant {
 public:
  /// Reads and checks the table. @throws io::UserError
  Solver(const io::Table& root, const std::string& name);

  protocol::Introduction introduce() const override { return {"dem", scene_.dimension, {"save", "checkpoint"}, largest_step_}; }
  std::vector<protocol::Surface> start(const protocol::Run& run) override;
  protocol::Advance advance(const protocol::Window& window, const std::vector<protocol::Field>& received) override;
  std::vector<std::pair<std::string, double>> finish() override;
  void save() override;
  void restore() override;
  void checkpoint(const std::string& folder) override;
  void resume(const std::string& folder) override;

 private:
  /// What only this class knows of a state.
  template <class Archive>
  void state(Archive& archive) {
    archive("steps", steps_);
    archive("step_watch", step_watch_);
    archive("next_picture", next_picture_);
  }
  void begin(WallSet walls);
  void make(Particles particles, WallSet walls);
  void open_pictures();
  void write_state(const std::string& path);

  void check_uses(const protocol::Run& run);
  std::size_t wall_of(const std::string& surface) const;
  Particles first_particles(const WallSet& walls) const;
  void settle(Engine& engine) const;
  Particles settled_between_standing_walls(Particles particles) const;
  void prescribe(const protocol::Window& window, const std::vector<protocol::Field>& received);
  std::vector<geometry::Vec3> displacement(std::size_t followed) const;
  void step_through(std::uint64_t steps, double step);
  std::vector<std::pair<std::string, double>> quantities(double step);
  void write_output(const protocol::Window& window);
  void write_particles(double time);
  void write_moving_walls(double time);

  Scene scene_;
  double largest_step_;
  StepWatch step_watch_;
  std::optional<WallSet> resuming_;  // between start() and resume()
  std::unique_ptr<Engine> engine_;
  std::unique_ptr<Traffic> traffic_;
  std::vector<std::size_t> sent_, received_, followed_;  // walls the coupling uses
  std::vector<std::vector<geometry::Vec3>> places_;      // of the vertices of those that are followed, as the case gives them [m]
  WallLoad load_;                             // mean over the window
  io::State saved_;
  protocol::Run run_;
  std::unique_ptr<io::PvdSeries> pictures_;
  std::vector<std::pair<std::size_t, io::PvdSeries>> wall_pictures_;  // of walls that move and have vertices
  double next_picture_ = 0;
  std::uint64_t steps_ = 0;
  std::size_t couples_lost_ = 0, triangles_dropped_ = 0;
  double seconds_ = 0;
  double last_step_ = 0, last_rate_ = 0;
};

}  // namespace acopla::dem
