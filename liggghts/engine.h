// LIGGGHTS on all processes, driven by the first.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "liggghts/deck.h"
#include "liggghts/team.h"
#include "liggghts/wall_sums.h"

namespace acopla::liggghts {

enum Order : int { order_end, order_make, order_advance, order_gather };

/// What a window came to, on the first process.
struct Progress {
  std::vector<double> load;  ///< WallSums::mean() of all processes
  double kinetic_energy = 0;  ///< at the window's end [J]
  double mass = 0;            ///< [kg]
  std::uint64_t particles = 0;
};

/// A particle in a picture.
struct Seen {
  double id, radius, position[3], velocity[3];
};

class Engine {
 public:
  explicit Engine(Team& team) : team_(team) {}
  ~Engine();

  // Of the first process; the others follow. Each @throws Failure with LIGGGHTS's words
  void make(const Deck& deck);
  Progress advance(std::uint64_t steps, double step);
  std::vector<Seen> gather();

  /// The life of the other processes.
  void follow();

 private:
  template <class Act>
  auto guarded(const Act& act);
  void begin(Deck& deck);
  Progress take_steps(std::uint64_t steps, double step);
  std::vector<Seen> collect();
  void make_forces();
  void run(const std::string& command);

  Team& team_;
  void* liggghts_ = nullptr;
  Deck deck_;
  std::unique_ptr<WallSums> sums_;
  double step_ = 0;
  bool at_start_ = false;
};

}  // namespace acopla::liggghts
