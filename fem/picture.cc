#include "fem/picture.h"

#include <deal.II/dofs/dof_handler.h>
#include <deal.II/fe/fe_system.h>
#include <deal.II/fe/mapping_fe_field.h>
#include <deal.II/lac/vector.h>
#include <deal.II/numerics/data_out.h>

#include <fstream>

#include "fem/discretisation.h"
#include "io/error.h"
#include "io/results.h"

namespace acopla::fem {
namespace {

/// A nodal field in the order of a handler of d components a node. @param value  of (node,
/// component)
template <int d, class Value>
dealii::Vector<double> reorder(const Discretisation<d>& mesh, const dealii::DoFHandler<d>& handler,
                               const Value& value) {
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
      result[unknowns[i]] = value(nodes[node], static_cast<int>(component));
    }
    ++cell;
  }
  return result;
}

template <int d>
void write(std::ostream& file, const Mesh& mesh, const Vector& displacement,
           const Vector& von_mises) {
  const auto& discretisation = mesh.discretisation<d>();
  const dealii::FESystem<d> element(*discretisation.element, d);
  dealii::DoFHandler<d> handler(discretisation.triangulation);
  handler.distribute_dofs(element);
  const auto moved = reorder<d>(discretisation, handler, [&](std::size_t node, int c) {
    return displacement[d * static_cast<Eigen::Index>(node) + c];
  });
  const dealii::Vector<double> stress(von_mises.begin(), von_mises.end());

  dealii::DataOut<d> out;
  const std::vector vector_parts(d,
                                 dealii::DataComponentInterpretation::component_is_part_of_vector);
  out.add_data_vector(handler, moved, std::vector<std::string>(d, "displacement"), vector_parts);
  out.add_data_vector(discretisation.nodes, stress, "von_mises");
  const auto parts = static_cast<unsigned>(mesh.element().degree);
  if (mesh.curved()) {
    const auto positions = reorder<d>(
        discretisation, handler, [&](std::size_t node, int c) { return mesh.points()[node][c]; });
    const dealii::MappingFEField<d, d, dealii::Vector<double>> mapping(handler, positions);
    out.build_patches(mapping, parts, dealii::DataOut<d>::curved_inner_cells);
  } else {
    out.build_patches(*discretisation.mapping, parts);
  }
  dealii::DataOutBase::VtkFlags flags;
  flags.compression_level = dealii::DataOutBase::VtkFlags::best_speed;
  out.set_flags(flags);
  out.write_vtu(file);
}

}  // namespace

void write_picture(const std::string& path, const Mesh& mesh, const Vector& displacement,
                   const Vector& von_mises) {
  std::ofstream file(path, std::ios::binary);
  try {
    if (file)
      mesh.dimension() == 2 ? write<2>(file, mesh, displacement, von_mises)
                            : write<3>(file, mesh, displacement, von_mises);
  } catch (const std::exception&) {  // deal.II's, of a stream that went bad
    if (file) throw;
  }
  file.close();
  if (!file) io::give_up_writing(path, path);
}

}  // namespace acopla::fem
