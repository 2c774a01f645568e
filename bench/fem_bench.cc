// Measurements of the structure, one a process so that its peak memory is its own. Prints one JSON object a line.
//   fem_bench static SHAPE ELEMENT POISSON CELLS     cantilever; deflection of its end
//   fem_bench motion ELEMENT CELLS STEPS             a bar swings along itself; error against the closed form
//   fem_bench window CELLS                           a window of a structure in motion beside a stream of its factor
//   fem_bench deck CELLS FILE                        the cantilever as an input of CalculiX
//   fem_bench compare CELLS RESULT                   its displacements against those that CalculiX printed
#include <sys/resource.h>
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <fstream>
#include <functional>
#include <numbers>
#include <sstream>
#include <stdexcept>

#include "fem/dynamics.h"
#include "fem/elasticity.h"
#include "fem/grid.h"
#include "fem/loads.h"
#include "fem/statics.h"

using namespace acopla::fem;

namespace {

double now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

double peak_mebibytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024;
}

struct Choice {
  int degree;
  Formulation formulation;
};

Choice choice(const std::string& element, bool plane_stress = false) {
  Choice result{element.starts_with("Q2") ? 2 : 1, {}};
  if (element.ends_with("b_bar")) result.formulation.locking = Formulation::Locking::b_bar;
  if (plane_stress) result.formulation.plane = Formulation::Plane::stress;
  return result;
}

/// A bar of 1 m, `height` high (and deep), of 1 / height · n × n (× n) cells.
Grid bar(int dimension, double height, int cells) {
  const int along = static_cast<int>(std::lround(1 / height)) * cells;
  return {.name = "bar",
          .dimension = dimension,
          .cells = {along, cells, dimension == 3 ? cells : 1},
          .corner =
              [=](const GridIndex& i) {
                return Vec3(static_cast<double>(i[0]) / along, height * i[1] / cells,
                            dimension == 3 ? height * i[2] / cells : 0.0);
              },
          .sides = side_name};
}

Fixed clamped(const Mesh& mesh) {
  Fixed fixed(mesh.unknowns(), 0);
  hold(mesh.boundary("x0"), {true, true, true}, fixed, mesh.dimension());
  return fixed;
}

/// A shear of 1 MPa on the end, downward.
Vector end_shear(const Mesh& mesh) {
  Load load(acopla::io::Table::from_text("", "bench"));
  load.kind = Load::Kind::traction;
  load.value = mesh.dimension() == 2 ? Vec3(0, -1e6, 0) : Vec3(0, 0, -1e6);
  load.part.groups = {"x1"};
  return nodal_forces(load, mesh, {});
}

void cantilever(const std::string& shape, const std::string& element, double poisson, int cells) {
  const double start = now();
  const auto [degree, formulation] = choice(element);
  const int dimension = shape == "plane" ? 2 : 3;
  const Mesh mesh(build(bar(dimension, 0.1, cells)), degree);
  const auto fixed = clamped(mesh);
  Statics statics(mesh, Material{2.1e11, poisson, {}}, fixed, {}, formulation);
  statics.prepare();
  const auto load = end_shear(mesh);
  const auto solution = statics.solve(load);
  const double seconds = now() - start;
  // The work of the load: the deflection of the end, weighed as the load is; twice the order of the energy norm.
  fmt::print("{{\"deflection\": {:.17g}, \"unknowns\": {}, \"seconds\": {:.6g}, \"mebibytes\": {:.1f}}}\n",
             load.dot(solution.displacement) / load.lpNorm<1>(), mesh.unknowns(), seconds, peak_mebibytes());
}

// Without Poisson's contraction a bar on rollers is one-dimensional: u = cos(ω t) sin(π x / 2 L), ω = π / (2 L) sqrt(E / ρ).
void motion(const std::string& element, int cells, int steps) {
  const double start = now();
  const auto [degree, formulation] = choice(element);
  const Mesh mesh(build(bar(2, 0.1, cells)), degree);
  const Material material{1e4, 0, 1};
  const auto K = assemble_stiffness(mesh, material, formulation);
  const auto M = assemble_mass(mesh, material, formulation, K.pattern());
  Supports supports(mesh);
  supports.hold("clamp", mesh, nodes_of(mesh.boundary("x0")), {true, false, false});
  supports.hold("roller", mesh, nodes_of(mesh.boundary("y0")), {false, true, false});
  const Loads none(mesh);
  Dynamics dynamics(mesh, K, M, {}, supports, none, {}, {});
  const double omega = std::numbers::pi / 2 * std::sqrt(1e4);
  Vector shape = mesh.zero();
  for (std::size_t n = 0; n < mesh.nodes(); ++n)
    add_at(shape, n, 2, Vec3(std::sin(std::numbers::pi / 2 * mesh.points()[n][0]), 0, 0));
  Motion motion{shape, mesh.zero(), {}, {}, 0};
  const double periods = 2.25, length = periods * 2 * std::numbers::pi / omega / steps;
  for (int k = 0; k < steps; ++k) {
    motion.time = k * length;
    dynamics.advance(motion, mesh.zero(), length, 1);
  }
  // After so many and a quarter periods the bar is straight and at its fastest: its phase is all that is wrong.
  const double error = motion.displacement.norm() / shape.norm();
  fmt::print("{{\"error\": {:.6g}, \"unknowns\": {}, \"seconds\": {:.6g}, \"mebibytes\": {:.1f}}}\n", error, mesh.unknowns(),
             now() - start, peak_mebibytes());
}

double best_of(int rounds, const std::function<void()>& work) {
  double best = HUGE_VAL;
  for (int r = 0; r < rounds; ++r) {
    const double start = now();
    work();
    best = std::min(best, now() - start);
  }
  return best;
}

double median_of(int rounds, const std::function<void()>& work) {
  std::vector<double> times;
  for (int r = 0; r < rounds; ++r) times.push_back(best_of(1, work));
  std::nth_element(times.begin(), times.begin() + rounds / 2, times.end());
  return times[static_cast<std::size_t>(rounds / 2)];
}

/// The sum of all, in eight sums at a time: as fast as memory brings it.
double stream(const std::vector<double>& values) {
  using Lanes = Eigen::Array<double, 32, 1>;
  Lanes sum = Lanes::Zero();
  for (std::size_t i = 0; i + 32 <= values.size(); i += 32) sum += Eigen::Map<const Lanes>(values.data() + i);
  return sum.sum();
}

void window(int cells) {
  const Mesh mesh(build(bar(3, 0.1, cells)), 1);
  const Material material{2.1e11, 0.3, 7850};
  const auto K = assemble_stiffness(mesh, material);
  const auto M = assemble_mass(mesh, material, {}, K.pattern());
  Supports supports(mesh);
  supports.hold("clamp", mesh, nodes_of(mesh.boundary("x0")), {true, true, true});
  const Loads none(mesh);
  Dynamics dynamics(mesh, K, M, {}, supports, none, {}, {});
  const double step = 1e-5;
  dynamics.prepare(step);
  const auto load = end_shear(mesh);
  Motion motion{mesh.zero(), mesh.zero(), {}, {}, 0};
  Vector change;
  const auto& solver = dynamics.solver();
  const std::vector<double> factor(static_cast<std::size_t>(solver.factor_bytes / 8), 1.0);
  volatile double sum = 0;
  // Turns of each, so that what else the machine does strikes all alike.
  std::vector<double> streams, solves, windows;
  for (int turn = 0; turn < 15; ++turn) {
    streams.push_back(median_of(3, [&] { sum = stream(factor); }));
    solves.push_back(median_of(3, [&] { solver.solver->solve(load, change); }));
    windows.push_back(median_of(3, [&] { dynamics.advance(motion, load, step, 1); }));
  }
  const auto middle = [](std::vector<double> v) {
    std::nth_element(v.begin(), v.begin() + std::ssize(v) / 2, v.end());
    return v[v.size() / 2];
  };
  fmt::print("{{\"stream\": {:.6g}, \"solve\": {:.6g}, \"window\": {:.6g}, \"factor\": {:.6g}, \"unknowns\": {}, \"mebibytes\": {:.1f}}}\n",
             middle(streams), middle(solves), middle(windows), solver.factor_bytes, mesh.unknowns(), peak_mebibytes());
}

void deck(int cells, const std::string& file) {
  const Mesh mesh(build(bar(3, 0.1, cells)), 1);
  std::ofstream out(file);
  out << "*NODE, NSET=ALL\n";
  for (std::size_t n = 0; n < mesh.nodes(); ++n)
    out << fmt::format("{}, {:.16g}, {:.16g}, {:.16g}\n", n + 1, mesh.points()[n][0], mesh.points()[n][1], mesh.points()[n][2]);
  out << "*ELEMENT, TYPE=C3D8, ELSET=SOLID\n";
  for (std::size_t c = 0; c < mesh.cells(); ++c) {
    const auto cell = mesh.cell(c);
    out << c + 1;
    for (const std::size_t a : {0, 1, 3, 2, 4, 5, 7, 6}) out << ", " << cell[a] + 1;
    out << '\n';
  }
  out << "*NSET, NSET=CLAMP\n";
  for (const auto n : nodes_of(mesh.boundary("x0"))) out << n + 1 << ",\n";
  out << "*MATERIAL, NAME=STEEL\n*ELASTIC\n2.1E11, 0.3\n*SOLID SECTION, ELSET=SOLID, MATERIAL=STEEL\n"
         "*BOUNDARY\nCLAMP, 1, 3\n*STEP\n*STATIC, SOLVER=SPOOLES\n*CLOAD\n";
  const auto load = end_shear(mesh);
  for (Eigen::Index i = 0; i < load.size(); ++i)
    if (load[i] != 0) out << fmt::format("{}, {}, {:.16g}\n", i / 3 + 1, i % 3 + 1, load[i]);
  out << "*NODE PRINT, NSET=ALL\nU\n*NODE FILE\nU\n*EL FILE\nS\n*END STEP\n";
  if (!out.flush()) throw std::runtime_error("cannot write " + file);
}

void compare(int cells, const std::string& file) {
  const Mesh mesh(build(bar(3, 0.1, cells)), 1);
  const auto fixed = clamped(mesh);
  std::ifstream in(file);
  Vector theirs = mesh.zero();
  std::size_t read = 0;
  double rounding = 0;  // half a unit of the seventh digit, which is the last that CalculiX prints
  for (std::string line; std::getline(in, line);) {
    std::istringstream words(line);
    std::size_t node = 0;
    Vec3 u;
    if (!(words >> node >> u[0] >> u[1] >> u[2]) || node == 0 || node > mesh.nodes()) continue;
    theirs.segment<3>(3 * static_cast<Eigen::Index>(node - 1)) = u;
    const double biggest = u.lpNorm<Eigen::Infinity>();
    if (biggest > 0) rounding = std::max(rounding, 0.5e-6 * std::pow(10.0, std::floor(std::log10(biggest))));
    ++read;
  }
  if (read != mesh.nodes()) throw std::runtime_error(fmt::format("{} has {} of {} nodes", file, read, mesh.nodes()));
  std::string line = "{";
  for (const bool b_bar : {false, true}) {
    Formulation formulation;
    if (b_bar) formulation.locking = Formulation::Locking::b_bar;
    Statics statics(mesh, Material{2.1e11, 0.3, {}}, fixed, {}, formulation);
    statics.prepare();
    const auto u = statics.solve(end_shear(mesh)).displacement;
    const double scale = u.lpNorm<Eigen::Infinity>();
    line += fmt::format("\"{}\": {:.6g}, ", b_bar ? "b_bar" : "plain", (u - theirs).lpNorm<Eigen::Infinity>() / scale);
    if (!b_bar) line += fmt::format("\"condition\": {:.6g}, \"rounding\": {:.6g}, ", statics.condition(), rounding / scale);
  }
  fmt::print("{}\"unknowns\": {}}}\n", line, mesh.unknowns());
}

}  // namespace

int main(int argc, char** argv) try {
  const std::vector<std::string> words(argv + 1, argv + argc);
  const auto is = [&](const char* name, std::size_t count) { return words.size() == count + 1 && words[0] == name; };
  if (is("static", 4))
    cantilever(words[1], words[2], std::stod(words[3]), std::stoi(words[4]));
  else if (is("motion", 3))
    motion(words[1], std::stoi(words[2]), std::stoi(words[3]));
  else if (is("window", 1))
    window(std::stoi(words[1]));
  else if (is("deck", 2))
    deck(std::stoi(words[1]), words[2]);
  else if (is("compare", 2))
    compare(std::stoi(words[1]), words[2]);
  else
    throw std::invalid_argument("usage: see the head of fem_bench.cc");
  return 0;
} catch (const std::exception& error) {
  fmt::print(stderr, "fem_bench: {}\n", error.what());
  return 1;
}
