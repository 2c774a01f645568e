// What a solver implements to be coupled. It never learns who is on the other side.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "geometry/surface_mesh.h"
#include "protocol/message.h"

namespace acopla::protocol {

/// What a solver says of itself before it has read anything large.
struct Introduction {
  std::string solver;                     ///< e.g. "dem"
  int dimension = 3;                      ///< 2 or 3
  std::vector<std::string> capabilities;  ///< of "save", "checkpoint"; what is not listed is answered by an error
  double step = 0;                        ///< the longest it takes by itself [s], for windows of so many steps; 0: it does not say
};

/// What the coupler tells a solver about the run.
struct Run {
  double tick = 0;            ///< length of a tick [s]
  std::int64_t end = 0;       ///< end of coupled time [ticks]
  std::int64_t window = 0;    ///< nominal length of a window [ticks]
  double gravity[3] = {0, 0, 0};  ///< [m/s²]
  std::string results;        ///< folder for the solver's own results; empty: write none
  /// Surfaces the coupling uses, with the fields it will send and expects back; surfaces not named here need not be
  /// computed, stored or sent.
  struct Use {
    std::string surface;
    std::vector<std::string> receives;  ///< fields the solver is given, e.g. "force"
    std::vector<std::string> sends;     ///< fields the solver must give, e.g. "displacement"
  };
  std::vector<Use> uses;
  /// A call of resume() follows start(): what it brings, particles that settle or an equilibrium, need not be made first.
  bool resumes = false;
  /// Surfaces that send their motion should bring `mass`: an explicit scheme will ask how far it is from its limits. Otherwise nobody reads it.
  bool wants_mass = false;
  double time(std::int64_t ticks) const { return static_cast<double>(ticks) * tick; }
};

struct Surface {
  std::string name;
  geometry::SurfaceMesh mesh;  ///< reference position
  /// Where it is and how it moves when coupled time begins, per point [m], [m/s]; empty: at rest in its reference position.
  std::vector<Eigen::Vector3d> displacement = {}, velocity = {};
  /// Of a structure in motion: what a sudden force on a point alone would accelerate, by direction, 1/(M⁻¹)_nn [kg]; 0 where it is held.
  /// The coupler compares it with the stiffness of what touches it. Empty: not known.
  std::vector<Eigen::Vector3d> mass = {};
};

/// A span of coupled time, in ticks and seconds.
struct Window {
  std::int64_t start = 0, end = 0;  ///< [ticks]
  double start_time = 0;            ///< [s]
  double length = 0;                ///< [s]
  /// The coupler asks how stiffly the surfaces that are moved are held by what touches them: the fields `stiffness` [N/m] and `dashpot`
  /// [N s/m], and the `mass` [kg] of what touches, beside the others, in every component the sum over the contacts. Who does not know sends none.
  bool estimate = false;
  double end_time() const { return start_time + length; }
};

/// A value per point of a surface. `force` is the mean over the window [N]. Of what is sent, `displacement` [m] and `velocity` [m/s] are
/// those at the window's end; of what is received, those at its start, and `end_displacement` and `end_velocity`, of an
/// implicit scheme, those at its end.
struct Field {
  std::string surface;
  std::string name;
  std::vector<Eigen::Vector3d> values;  ///< one per point of the surface, in its order
};

/// What a solver reports of a window: its fields and its scalar quantities, named as a user names them in [expect]
/// ("reaction.z", "von_mises.max", "force.z"). Units are SI.
struct Advance {
  std::vector<Field> fields;
  std::vector<std::pair<std::string, double>> quantities;
  std::uint64_t steps = 0;  ///< the solver's own steps in this window
};

class Participant {
 public:
  virtual ~Participant() = default;

  virtual Introduction introduce() const = 0;
  /// Reads meshes, builds matrices, inserts particles. Called once. @return the surfaces named in `run.uses` (at least).
  virtual std::vector<Surface> start(const Run& run) = 0;
  /// Computes one window. Windows follow one another without gaps unless restore() was called or the coupling skips
  /// windows that a static structure does not need.
  virtual Advance advance(const Window& window, const std::vector<Field>& received) = 0;
  /// The run ends well: write what is left to write. @return values for the summary ("seconds.solve", …)
  virtual std::vector<std::pair<std::string, double>> finish() { return {}; }

  /// Remember / return to the present state (implicit coupling). Default: not supported.
  virtual void save();
  virtual void restore();

  /// Writes everything that the run needs to go on bit by bit into files of an existing folder, which begin with the participant's name.
  /// Nothing of what follows changes by it. Default: not supported.
  virtual void checkpoint(const std::string& folder);
  /// Right after start() of the same case: goes on from such files, and cuts its lists of results to that instant. Default: not supported.
  virtual void resume(const std::string& folder);
};

/// A solver was asked for something it did not list among its capabilities.
class Unsupported : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

}  // namespace acopla::protocol
