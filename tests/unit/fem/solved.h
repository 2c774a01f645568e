// A case solved in one line, for tests that read as physics.
#pragma once

#include <memory>
#include <string>

#include "fem/grid.h"
#include "fem/model.h"
#include "fem/statics.h"
#include "fem/stress.h"

namespace acopla::fem::test {

/// The static structure of a case (without [structure] and material heading) under its own loads at
/// `time`.
class Solved {
 public:
  /// @param grid  replaces the mesh of the case unless null
  Solved(const std::string& text, const Vec3& gravity = Vec3::Zero(), const Grid* grid = nullptr,
         double time = 0)
      : settings_(read_settings(io::Table::from_text(text, "case.toml"), "structure")) {
    if (grid) settings_.mesh.make = [copy = *grid] { return build(copy); };
    model_ = std::make_unique<Model>(settings_, gravity);
    const auto stiffness = stiffness_of(settings_, *model_);
    Statics statics(model_->mesh, stiffness, model_->supports.fixed(), settings_.solver);
    statics.prepare();
    Vector prescribed = model_->mesh.zero();
    model_->supports.place(time, prescribed);
    load_ = model_->loads.at(time);
    solution_ = statics.solve(load_, {}, prescribed);
    stress_ = std::make_unique<Stress>(model_->mesh, model_->materials, settings_.formulation);
  }

  const Mesh& mesh() const { return model_->mesh; }
  const Vector& load() const { return load_; }
  const StaticSolution& solution() const { return solution_; }
  const Stress& stress() const { return *stress_; }
  /// Displacement of the node nearest to a point [m].
  Vec3 at(const Vec3& point) const {
    return value_at(solution_.displacement, mesh().nearest_node(point), mesh().dimension());
  }
  /// Nodal stress nearest to a point, Voigt xx, yy, zz, yz, xz, xy [Pa].
  StressVector stress_at(const Vec3& point) const {
    return stress_->nodal(solution_.displacement).col(mesh().nearest_node(point));
  }

 private:
  Settings settings_;
  std::unique_ptr<Model> model_;
  Vector load_;
  StaticSolution solution_;
  std::unique_ptr<Stress> stress_;
};

}  // namespace acopla::fem::test
