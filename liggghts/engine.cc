#include "liggghts/engine.h"

#include <fix_external.h>
#include <fmt/format.h>
#include <lammps.h>
#include <library.h>
#include <modify.h>

#include <sstream>

#include "liggghts/failure.h"

namespace acopla::liggghts {
namespace {

LAMMPS_NS::LAMMPS* of(void* liggghts) { return static_cast<LAMMPS_NS::LAMMPS*>(liggghts); }

template <class T>
T* atoms(void* liggghts, const char* name) {
  return static_cast<T*>(lammps_extract_atom(liggghts, name));
}
int local_count(void* liggghts) { return *static_cast<int*>(lammps_extract_global(liggghts, "nlocal")); }

}  // namespace

Engine::~Engine() {
  sums_.reset();
  if (liggghts_ && !std::uncaught_exceptions()) lammps_close(liggghts_);
}

// What a failure leaves of the team: where only this process has failed, the others wait for it within LIGGGHTS.
template <class Act>
auto Engine::guarded(const Act& act) {
  try {
    return act();
  } catch (const Failure& failure) {
    team_.set(failure.of_all() ? Team::Bond::parted : team_.size() > 1 ? Team::Bond::broken : Team::Bond::together);
    liggghts_ = nullptr;  // in the middle of something: not to be touched again
    throw;
  } catch (...) {
    team_.set(team_.size() > 1 ? Team::Bond::broken : Team::Bond::together);
    liggghts_ = nullptr;
    throw;
  }
}

void Engine::make(const Deck& deck) {
  deck_ = deck;
  team_.send(order_make);
  guarded([&] { begin(deck_); });
}

Progress Engine::advance(std::uint64_t steps, double step) {
  team_.send(order_advance);
  return guarded([&] { return take_steps(steps, step); });
}

std::vector<Seen> Engine::gather() {
  team_.send(order_gather);
  return guarded([&] { return collect(); });
}

void Engine::follow() {
  guarded([&] {
    for (;;) switch (team_.receive()) {
        case order_make: begin(deck_); break;
        case order_advance: take_steps(0, 0); break;
        case order_gather: collect(); break;
        default: return;
      }
  });
}

void Engine::run(const std::string& command) { lammps_command(liggghts_, command.c_str()); }

void Engine::begin(Deck& deck) {
  team_.share(deck.commands);
  std::vector<std::uint64_t> counts{deck.meshes.size(), deck.planes.size(), deck.particles};
  team_.share(counts);
  deck.meshes.resize(counts[0]);
  deck.planes.resize(counts[1]);
  deck.particles = counts[2];
  for (auto& mesh : deck.meshes) {
    team_.share(mesh.name);
    std::vector<double> coordinates;
    for (const auto& point : mesh.points) coordinates.insert(coordinates.end(), point.data(), point.data() + 3);
    team_.share(coordinates);
    mesh.points.clear();
    for (std::size_t k = 0; k < coordinates.size(); k += 3) mesh.points.emplace_back(coordinates[k], coordinates[k + 1], coordinates[k + 2]);
    team_.share(mesh.triangles);
  }
  for (auto& plane : deck.planes) team_.share(plane);

  // Its screen is not wanted, but must be there: it writes without looking. Errors and warnings come by themselves (liggghts/failure.cc).
  std::vector<std::string> words{"liggghts", "-log", "none", "-screen", "/dev/null"};
  std::vector<char*> arguments;
  for (auto& word : words) arguments.push_back(word.data());
  lammps_open(static_cast<int>(arguments.size()), arguments.data(), MPI_COMM_WORLD, &liggghts_);
  std::istringstream lines(deck.commands);
  for (std::string line; std::getline(lines, line);) run(line);
  const auto made = static_cast<std::uint64_t>(lammps_get_natoms(liggghts_));
  if (made != deck.particles) throw Failure(fmt::format("LIGGGHTS read {} of {} particles. Do all lie in the domain?", made, deck.particles), true);

  // Last of all, so that it is called when all forces of a step are there.
  run("fix acopla all external pf/callback 1 2000000000");
  sums_ = std::make_unique<WallSums>(of(liggghts_), deck_);
  auto* const external = static_cast<LAMMPS_NS::FixExternal*>(of(liggghts_)->modify->find_fix_id("acopla"));
  external->set_callback(
      [](void* self, LAMMPS_NS::bigint, int count, int*, double**, double** added) {
        for (int i = 0; i < count; ++i) added[i][0] = added[i][1] = added[i][2] = 0;
        auto& engine = *static_cast<Engine*>(self);
        if (engine.at_start_) engine.sums_->begin_at_rest();
        else engine.sums_->add_step();
      },
      this);
  make_forces();  // a mesh that LIGGGHTS does not take is refused here, before time begins
}

void Engine::make_forces() {
  at_start_ = true;
  run("run 0 post no");
  at_start_ = false;
}

Progress Engine::take_steps(std::uint64_t steps, double step) {
  std::vector<double> numbers{static_cast<double>(steps), step};
  team_.share(numbers);
  steps = static_cast<std::uint64_t>(numbers[0]);
  step = numbers[1];
  if (step != step_) {
    run(fmt::format("timestep {:.17g}", step));
    make_forces();  // which is also when LIGGGHTS reads the step
    step_ = step;
  }
  sums_->begin(steps);
  run(fmt::format("run {} pre no post no", steps));

  Progress progress;
  progress.load = sums_->mean();
  const auto* const* const v = atoms<double*>(liggghts_, "v");
  const auto* const* const spin = atoms<double*>(liggghts_, "omega");
  const auto* const mass = atoms<double>(liggghts_, "rmass");
  const auto* const radius = atoms<double>(liggghts_, "radius");
  for (int i = 0; i < local_count(liggghts_); ++i) {
    const Eigen::Map<const dem::Vec3> velocity(v[i]), turn(spin[i]);
    progress.kinetic_energy += 0.5 * mass[i] * (velocity.squaredNorm() + 0.4 * radius[i] * radius[i] * turn.squaredNorm());
    progress.mass += mass[i];
  }
  std::vector<double> others{progress.kinetic_energy, progress.mass, static_cast<double>(local_count(liggghts_))};
  team_.sum(others);
  team_.sum(progress.load);
  progress.kinetic_energy = others[0];
  progress.mass = others[1];
  progress.particles = static_cast<std::uint64_t>(others[2]);
  return progress;
}

std::vector<Seen> Engine::collect() {
  const auto* const tag = atoms<int>(liggghts_, "id");
  const auto* const* const x = atoms<double*>(liggghts_, "x");
  const auto* const* const v = atoms<double*>(liggghts_, "v");
  const auto* const radius = atoms<double>(liggghts_, "radius");
  std::vector<Seen> own;
  for (int i = 0; i < local_count(liggghts_); ++i)
    own.push_back({tag ? static_cast<double>(tag[i]) : 0, radius[i], {x[i][0], x[i][1], x[i][2]}, {v[i][0], v[i][1], v[i][2]}});
  // One after another to the first: MPI_Gatherv counts in int.
  if (!team_.leads()) {
    const auto count = own.size();
    MPI_Send(&count, sizeof count, MPI_BYTE, 0, 0, MPI_COMM_WORLD);
    MPI_Send(own.data(), static_cast<int>(count * 8), MPI_DOUBLE, 0, 1, MPI_COMM_WORLD);
    return {};
  }
  for (int rank = 1; rank < team_.size(); ++rank) {
    std::size_t count = 0;
    MPI_Recv(&count, sizeof count, MPI_BYTE, rank, 0, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
    own.resize(own.size() + count);
    MPI_Recv(own.data() + own.size() - count, static_cast<int>(count * 8), MPI_DOUBLE, rank, 1, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
  }
  return own;
}

}  // namespace acopla::liggghts
