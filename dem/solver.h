// The particles as a participant: surfaces are the mesh walls, the field they send is `force`.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "dem/engine.h"
#include "io/vtk.h"
#include "protocol/participant.h"

namespace acopla::dem {

/// Sends `force` [N] on every wall that is a mesh: the mean over the window, per vertex. Quantities of a window, in the
/// order of the case's walls: WALL.force.x|y|z [N] (mean over the window), then weight [N], kinetic_energy [J], particles,
/// contacts, step_ratio, overlap.max (over the radius).
class Solver final : public protocol::Participant {
 public:
  /// Reads and checks the table. @throws io::UserError
  Solver(const io::Table& root, const std::string& name);

  protocol::Introduction introduce() const override { return {"dem", 3, {}}; }
  std::vector<protocol::Surface> start(const protocol::Run& run) override;
  protocol::Advance advance(const protocol::Window& window, const std::vector<protocol::Field>& received) override;
  std::vector<std::pair<std::string, double>> finish() override;

 private:
  void check_uses(const protocol::Run& run) const;
  std::vector<std::pair<std::string, double>> quantities(double step) const;
  void write_particles(double time);

  Scene scene_;
  double largest_step_;
  std::unique_ptr<Engine> engine_;
  std::vector<std::string> sent_;  // walls the coupling uses
  std::vector<std::uint32_t> first_vertex_;
  protocol::Run run_;
  std::unique_ptr<io::PvdSeries> pictures_;
  double next_picture_ = 0;
  std::uint64_t steps_ = 0;
  std::size_t couples_lost_ = 0, triangles_dropped_ = 0;
  double seconds_ = 0;
  double last_step_ = 0, last_rate_ = 0;
};

}  // namespace acopla::dem
