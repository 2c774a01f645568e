#include "fem/supports.h"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>

namespace acopla::fem {
namespace {

using Mode = Eigen::Matrix<double, 6, 1>;  // rotation ω L, then translation t: u = t + ω × (x − c)

std::size_t root_of(std::vector<std::size_t>& parents, std::size_t node) {
  while (parents[node] != node) node = parents[node] = parents[parents[node]];
  return node;
}

/// Part that each node belongs to, numbered from 0; nodes of one cell are of one part.
std::vector<std::size_t> parts_of(const Mesh& mesh, std::size_t& count) {
  std::vector<std::size_t> parents(mesh.nodes());
  std::iota(parents.begin(), parents.end(), std::size_t{0});
  for (std::size_t c = 0; c < mesh.cells(); ++c) {
    const auto nodes = mesh.cell(c);
    for (const auto node : nodes) parents[root_of(parents, node)] = root_of(parents, nodes[0]);
  }
  count = 0;
  std::vector<std::size_t> numbers(mesh.nodes()), parts(mesh.nodes());
  for (std::size_t n = 0; n < mesh.nodes(); ++n)
    if (root_of(parents, n) == n) numbers[n] = count++;
  for (std::size_t n = 0; n < mesh.nodes(); ++n) parts[n] = numbers[root_of(parents, n)];
  return parts;
}

struct Part {
  Vec3 sum = Vec3::Zero(), low = Vec3::Constant(HUGE_VAL), high = Vec3::Constant(-HUGE_VAL);
  double nodes = 0;
  Eigen::Matrix<double, 6, 6> held = Eigen::Matrix<double, 6, 6>::Zero();  // Σ row rowᵀ
  Vec3 centre() const { return sum / nodes; }
  double size() const { return (high - low).norm(); }
};

std::vector<Part> measure_parts(const Mesh& mesh, const std::vector<std::size_t>& part_of,
                                std::size_t count, const Fixed& fixed) {
  std::vector<Part> parts(count);
  for (std::size_t n = 0; n < mesh.nodes(); ++n) {
    auto& part = parts[part_of[n]];
    part.sum += mesh.points()[n];
    part.low = part.low.cwiseMin(mesh.points()[n]);
    part.high = part.high.cwiseMax(mesh.points()[n]);
    part.nodes += 1;
  }
  for (std::size_t n = 0; n < mesh.nodes(); ++n) {
    auto& part = parts[part_of[n]];
    const Vec3 arm = (mesh.points()[n] - part.centre()) / part.size();
    for (int d = 0; d < 3; ++d) {
      // A body in 2D does not leave its plane: as if held along z.
      if (d < mesh.dimension() &&
          !fixed[static_cast<std::size_t>(mesh.dimension()) * n + static_cast<std::size_t>(d)])
        continue;
      Mode row;
      row.head<3>() = arm.cross(Vec3(Vec3::Unit(d)));  // e_d · (ω × arm) = ω · (arm × e_d)
      row.tail<3>() = Vec3::Unit(d);
      part.held += row * row.transpose();
    }
  }
  return parts;
}

/// Basis of the null space in reduced echelon form, so that axes come out as axes.
std::vector<Mode> null_space(const Eigen::Matrix<double, 6, 6>& held) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>> solver(held);
  const auto& values = solver.eigenvalues();
  std::vector<Mode> basis;
  for (int i = 0; i < 6; ++i)
    if (values[i] <= 1e-12 * std::max(values[5], 1.0))
      basis.push_back(solver.eigenvectors().col(i));
  std::size_t done = 0;
  for (int column = 0; column < 6 && done < basis.size(); ++column) {
    auto pivot = done;
    for (auto i = done; i < basis.size(); ++i)
      if (std::abs(basis[i][column]) > std::abs(basis[pivot][column])) pivot = i;
    if (std::abs(basis[pivot][column]) < 1e-5) continue;
    std::swap(basis[done], basis[pivot]);
    basis[done] /= basis[done][column];
    for (std::size_t i = 0; i < basis.size(); ++i)
      if (i != done) basis[i] -= basis[i][column] * Mode(basis[done]);
    ++done;
  }
  return basis;
}

double rounded(double value) { return std::abs(value) < 1e-9 ? 0.0 : value; }

std::string direction_text(const Vec3& v) {
  const Vec3 unit = v.normalized();
  for (int d = 0; d < 3; ++d)
    if (std::abs(unit[d]) > 1 - 1e-9) return std::string(1, "xyz"[d]);
  return fmt::format("({:.3g}, {:.3g}, {:.3g})", rounded(unit[0]), rounded(unit[1]),
                     rounded(unit[2]));
}

std::string describe(const Mode& mode, const Part& part) {
  const Vec3 turn = mode.head<3>() / part.size(), shift = mode.tail<3>();
  if (turn.norm() * part.size() < 1e-6) return "move along " + direction_text(shift);
  // Points that a turn ω with shift t does not move, at best along the axis: c + ω × t / ω².
  Vec3 axis = part.centre() + turn.cross(shift) / turn.squaredNorm();
  const Vec3 unit = turn.normalized();
  axis -= unit * unit.dot(axis);  // the point of the axis nearest to the origin
  return fmt::format("turn about the axis along {} through ({:.3g}, {:.3g}, {:.3g})",
                     direction_text(turn), rounded(axis[0]), rounded(axis[1]), rounded(axis[2]));
}

}  // namespace

void hold(const std::vector<BoundaryFace>& faces, const std::array<bool, 3>& directions,
          Fixed& fixed, int dimension) {
  const auto count = static_cast<std::size_t>(dimension);
  for (const auto& face : faces)
    for (const auto node : face.used())
      for (std::size_t d = 0; d < count; ++d)
        if (directions[d]) fixed[count * std::size_t{node} + d] = 1;
}

void Supports::claim(const Mesh& mesh, std::uint32_t node, int direction) {
  const auto unknown =
      static_cast<std::size_t>(dimension_) * node + static_cast<std::size_t>(direction);
  const auto index = std::ssize(sources_) - 1;
  const auto& now = sources_.back();
  if (owner_[unknown] >= 0 && owner_[unknown] != index) {
    const auto& before = sources_[static_cast<std::size_t>(owner_[unknown])];
    const auto stays = [&](const Source& source) {
      return !source.moves || source.value[direction] == 0;
    };
    const bool same =
        (stays(now) && stays(before)) ||
        (now.moves && before.moves && now.value[direction] == before.value[direction] &&
         now.history == before.history);
    if (same) return;
    const auto& p = mesh.points()[node];
    throw std::invalid_argument(
        fmt::format("contradicts {}: both prescribe the displacement along {} at ({:.4g}, {:.4g}, "
                    "{:.4g}). Leave that direction out of "
                    "one of them (`directions`), or choose parts that share no node.",
                    before.name, "xyz"[direction], p[0], p[1], p[2]));
  }
  owner_[unknown] = static_cast<std::int32_t>(index);
  if (now.moves && now.value[direction] != 0)
    moved_.push_back({unknown, now.value[direction], sources_.size() - 1});
  fixed_[unknown] = 1;
}

void Supports::hold(const std::string& name, const Mesh& mesh,
                    const std::vector<std::uint32_t>& nodes,
                    const std::array<bool, 3>& directions) {
  sources_.push_back({name, false, Vec3::Zero(), {}});
  for (const auto node : nodes)
    for (int d = 0; d < dimension_; ++d)
      if (directions[static_cast<std::size_t>(d)]) claim(mesh, node, d);
}

void Supports::move(const std::string& name, const Mesh& mesh,
                    const std::vector<std::uint32_t>& nodes, const std::array<bool, 3>& directions,
                    const Vec3& value, const MotionHistory& history) {
  sources_.push_back({name, true, value, history});
  for (const auto node : nodes)
    for (int d = 0; d < dimension_; ++d)
      if (directions[static_cast<std::size_t>(d)]) claim(mesh, node, d);
}

std::vector<std::uint32_t> Supports::nodes() const {
  std::vector<std::uint32_t> result;
  const auto count = static_cast<std::size_t>(dimension_);
  for (std::size_t n = 0; n < fixed_.size() / count; ++n)
    if (std::any_of(fixed_.begin() + static_cast<std::ptrdiff_t>(count * n),
                    fixed_.begin() + static_cast<std::ptrdiff_t>(count * (n + 1)),
                    [](char mark) { return mark != 0; }))
      result.push_back(static_cast<std::uint32_t>(n));
  return result;
}

template <class Value>
void Supports::write(const Value& value_of, Vector& nodal) const {
  for (std::size_t i = 0; i < fixed_.size(); ++i)
    if (fixed_[i]) nodal[static_cast<Eigen::Index>(i)] = 0;
  for (const auto& [unknown, value, source] : moved_)
    nodal[static_cast<Eigen::Index>(unknown)] = value * value_of(sources_[source].history);
}

void Supports::place(double time, Vector& displacement) const {
  write([&](const MotionHistory& history) { return history.displacement(time); }, displacement);
}

void Supports::drive(double time, Vector& velocity) const {
  write([&](const MotionHistory& history) { return history.velocity(time); }, velocity);
}

void Supports::accelerate(double time, Vector& acceleration) const {
  write([&](const MotionHistory& history) { return history.acceleration(time); }, acceleration);
}

std::string free_motions(const Mesh& mesh, const Fixed& fixed) {
  std::size_t count = 0;
  const auto part_of = parts_of(mesh, count);
  const auto parts = measure_parts(mesh, part_of, count, fixed);
  for (const auto& part : parts) {
    const auto basis = null_space(part.held);
    if (basis.empty()) continue;
    std::string text;
    for (const auto& mode : basis) text += (text.empty() ? "" : ", ") + describe(mode, part);
    if (count == 1) return text;
    const Vec3 c = part.centre();
    return fmt::format(
        "{} (the mesh has {} parts that share no node; this one is around ({:.3g}, {:.3g}, "
        "{:.3g}))",
        text, count, rounded(c[0]), rounded(c[1]), rounded(c[2]));
  }
  return {};
}

}  // namespace acopla::fem
