#include "fem/picture.h"

#include <deal.II/dofs/dof_handler.h>
#include <deal.II/fe/fe_system.h>
#include <deal.II/lac/vector.h>
#include <deal.II/numerics/data_out.h>

#include <fstream>

#include "fem/discretisation.h"
#include "io/error.h"

namespace acopla::fem {
namespace {

/// The displacements in the order of a handler of three components a node.
dealii::Vector<double> reorder(const Discretisation& mesh, const dealii::DoFHandler<3>& handler,
                               const Vector& displacement) {
  const auto& element = handler.get_fe();
  dealii::Vector<double> result(handler.n_dofs());
  std::vector<dealii::types::global_dof_index> unknowns(element.n_dofs_per_cell()),
      nodes(mesh.element->n_dofs_per_cell());
  auto cell = mesh.nodes.begin_active();
  for (const auto& vector_cell : handler.active_cell_iterators()) {
    vector_cell->get_dof_indices(unknowns);
    cell->get_dof_indices(nodes);
    for (unsigned i = 0; i < unknowns.size(); ++i) {
      const auto [component, node] = element.system_to_component_index(i);
      result[unknowns[i]] = displacement[3 * Eigen::Index{nodes[node]} + component];
    }
    ++cell;
  }
  return result;
}

}  // namespace

void write_picture(const std::string& path, const Mesh& mesh, const Vector& displacement,
                   const Vector& von_mises) {
  const auto& discretisation = mesh.discretisation();
  const dealii::FESystem<3> element(*discretisation.element, 3);
  dealii::DoFHandler<3> handler(discretisation.triangulation);
  handler.distribute_dofs(element);
  const auto moved = reorder(discretisation, handler, displacement);
  const dealii::Vector<double> stress(von_mises.begin(), von_mises.end());

  dealii::DataOut<3> out;
  const std::vector vector_parts(3,
                                 dealii::DataComponentInterpretation::component_is_part_of_vector);
  out.add_data_vector(handler, moved, std::vector<std::string>(3, "displacement"), vector_parts);
  out.add_data_vector(discretisation.nodes, stress, "von_mises");
  out.build_patches(*discretisation.mapping, static_cast<unsigned>(mesh.element().degree));
  dealii::DataOutBase::VtkFlags flags;
  flags.compression_level = dealii::DataOutBase::VtkFlags::best_speed;
  out.set_flags(flags);
  std::ofstream file(path, std::ios::binary);
  if (file) out.write_vtu(file);
  if (!file.flush()) throw io::UserError(path + ": cannot be written. Is the disk full?");
}

}  // namespace acopla::fem
