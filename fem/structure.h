// The deal.II structure as a participant.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "fem/settings.h"
#include "io/vtk.h"
#include "protocol/participant.h"

namespace acopla::fem {

/// An elastic structure in static equilibrium with the forces of each window. Receives "force",
/// sends "displacement" and "velocity" (zero) on physical surfaces of its mesh. Reports reaction.x,
/// .y, .z (force of the supports on the structure), load.x, .y, .z (received forces and weight)
/// [N], displacement.max [m] and von_mises.max [Pa].
class Structure : public protocol::Participant {
 public:
  explicit Structure(Settings settings);
  ~Structure() override;

  protocol::Introduction introduce() const override;
  std::vector<protocol::Surface> start(const protocol::Run& run) override;
  protocol::Advance advance(const protocol::Window& window,
                            const std::vector<protocol::Field>& received) override;
  std::vector<std::pair<std::string, double>> finish() override;
  void save() override;
  void restore() override;

 private:
  struct Model;
  struct Coupled;
  Vector load_of(const std::vector<protocol::Field>& received) const;
  std::vector<protocol::Field> fields() const;
  bool is_due(const protocol::Window& window) const;
  void draw();

  /// What a rejected iteration must undo.
  struct State {
    Vector displacement;
    double time = 0;
    bool due = false;  ///< a picture of it is wanted
    bool drawn = true;
  };
  struct Seconds {
    double setup = 0, factor = 0, solve = 0;
  };

  Settings settings_;
  protocol::Run run_;
  std::unique_ptr<Model> model_;
  std::vector<Coupled> coupled_;
  State state_, saved_;
  Seconds seconds_;
  double worst_residual_ = 0;
  int pictures_ = 0;
  std::optional<io::PvdSeries> series_;
};

/// Plain lines on what a run will do: cells, unknowns, solver, memory, expected time. Reads the
/// mesh and analyses the stiffness, but factors nothing. @throws io::UserError
std::string explain(const Settings& settings);

}  // namespace acopla::fem
