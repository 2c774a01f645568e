// LIGGGHTS as a participant: the first of its processes.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "io/vtk.h"
#include "liggghts/engine.h"
#include "protocol/participant.h"

namespace acopla::liggghts {

/// Reads the table of solver = "dem", and places the particles as that does. Sends `force` [N] on every mesh wall: the mean over the window, per
/// vertex, exact in force and moment. Receives nothing: its walls stand.
///
/// Quantities of a window: per wall WALL.force.x|y|z [N], of meshes WALL.torque.x|y|z [N m] about the mean of the vertices; weight [N],
/// kinetic_energy [J], particles.
class Solver final : public protocol::Participant {
 public:
  /// Reads and checks the table. @param team  where mpirun has made one; else it is made when the run starts. @throws io::UserError
  Solver(const io::Table& root, const std::string& name, std::unique_ptr<Team>& team);
  ~Solver() override;

  protocol::Introduction introduce() const override { return {"liggghts", scene_.dimension, {}, largest_step_}; }
  std::vector<protocol::Surface> start(const protocol::Run& run) override;
  protocol::Advance advance(const protocol::Window& window, const std::vector<protocol::Field>& received) override;
  std::vector<std::pair<std::string, double>> finish() override;

 private:
  void check_uses(const protocol::Run& run);
  void write_particles(double time);
  std::vector<std::pair<std::string, double>> quantities(const Progress& progress) const;

  dem::Scene scene_;
  double largest_step_;
  std::unique_ptr<Team>& team_;
  std::unique_ptr<Engine> engine_;
  Deck deck_;
  protocol::Run run_;
  std::string folder_;
  bool folder_is_ours_ = false;
  std::vector<std::size_t> sent_;  // meshes
  std::unique_ptr<io::PvdSeries> pictures_;
  double next_picture_ = 0, seconds_ = 0, last_step_ = 0;
  std::uint64_t steps_ = 0;
  std::size_t couples_lost_ = 0;
};

/// For `acopla explain`.
std::string explain(const io::Table& root, const std::string& name);

}  // namespace acopla::liggghts
